"""What a reference is made with: the plan, and who does its many tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal, Protocol, TypeVar

import numpy as np

from fti.hil.approach_reference.approaches import NOMINAL, Spread, window_noise
from fti.hil.approach_reference.receivers import ReceiverModel

#: Length of the window that the limits are made for [m].
WINDOW_M = 400.0
#: So many receivers are drawn.
RECEIVERS = 60

Argument = TypeVar("Argument")
TaskResult = TypeVar("TaskResult")

#: Told what is being done and the share of it that is done, 0 to 1.
Progress = Callable[[str, float], None]


class TaskRunner(Protocol):
    """Does a task for each argument, somewhere, and gives what it returns in their order."""

    def __call__(
        self, task: Callable[[Argument], TaskResult], arguments: Iterable[Argument], progress: Callable[[float], None]
    ) -> list[TaskResult]:
        """``progress`` is told the share that is done."""


def run_serially(
    task: Callable[[Argument], TaskResult], arguments: Iterable[Argument], progress: Callable[[float], None]
) -> list[TaskResult]:
    """Here, one after the other."""
    todo, found = list(arguments), list[TaskResult]()
    for argument in todo:
        found.append(task(argument))
        progress(len(found) / len(todo))
    return found


@dataclass(frozen=True, slots=True)
class ReferenceOptions:
    """What a reference is made with.

    surface : name of the terrain or of the recordings, date : of their survey
    spread : what differs between approaches; the limits assume it
    receiver : model of the receivers that are drawn      receivers : how many
    runs : simulated approaches for the limits      beside_runs : for each offset of the table of detection
    obstacle_runs : over obstacles of each width in each part of the way; 0: no table of obstacles
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
    beside_runs: int = 100
    obstacle_runs: int = 100
    seed: int = 1
    pfa: float = 0.01
    pmd: float = 1e-3

    @property
    def nav_noise(self) -> float:
        """One sigma of the navigated height within a window [m]."""
        return round(window_noise(self.spread.nav_vertical, WINDOW_M / self.spread.speed_mean), 3)

    def rng(self, *stream: int) -> np.random.Generator:
        """Random numbers of one purpose, the same for the same numbers."""
        return np.random.default_rng([self.seed, *stream])
