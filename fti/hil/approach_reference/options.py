"""Options of a reference, and runners of its tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal, Protocol, TypeVar

import numpy as np

from fti.hil.approach_reference.approaches import NOMINAL, Spread, window_noise
from fti.hil.approach_reference.receivers import ReceiverModel

#: Length of the window of the limits [m].
WINDOW_M = 400.0
#: Number of drawn receivers.
RECEIVERS = 60

Argument = TypeVar("Argument")
TaskResult = TypeVar("TaskResult")

#: Called with the name of the current step and its completed share, 0 to 1.
Progress = Callable[[str, float], None]


class TaskRunner(Protocol):
    """Runs a task for each argument, in any process, and returns the results in order."""

    def __call__(
        self, task: Callable[[Argument], TaskResult], arguments: Iterable[Argument], progress: Callable[[float], None]
    ) -> list[TaskResult]:
        """progress : called with the completed share"""


def run_serially(
    task: Callable[[Argument], TaskResult], arguments: Iterable[Argument], progress: Callable[[float], None]
) -> list[TaskResult]:
    """Run the tasks in this process, one after the other."""
    tasks, results = list(arguments), list[TaskResult]()
    for argument in tasks:
        results.append(task(argument))
        progress(len(results) / len(tasks))
    return results


@dataclass(frozen=True, slots=True)
class ReferenceOptions:
    """Options of a reference.

    surface : name of the terrain or of the recordings, date : of their survey
    spread : variation between approaches, assumed by the limits
    receiver : model of the drawn receivers      receivers : their number
    runs : simulated approaches for the limits      offset_runs : for each offset of the table of detection
    obstacle_runs : over obstacles of each width in each part of the track; 0: no table of obstacles
    pfa : false alarms per approach, all tests together      pmd : missed detections
    """

    surface: str
    date: str
    made_from: Literal["terrain", "recordings"] = "terrain"
    s_max: float = 7000.0
    spread: Spread = NOMINAL
    receiver: ReceiverModel = "drawn"
    receivers: int = RECEIVERS
    draws: int = 100
    runs: int = 2000
    offset_runs: int = 100
    obstacle_runs: int = 100
    seed: int = 1
    pfa: float = 0.01
    pmd: float = 1e-3

    @property
    def nav_noise(self) -> float:
        """One sigma of the navigated height within a window [m]."""
        return round(window_noise(self.spread.nav_vertical, WINDOW_M / self.spread.speed_mean), 3)

    def rng(self, *stream: int) -> np.random.Generator:
        """Reproducible random generator of one purpose."""
        return np.random.default_rng([self.seed, *stream])
