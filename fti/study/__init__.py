"""Studies: each reproduces a published result and compares it with a target.

A study is a module or package of this package whose name does not begin with ``_``.  A study has:

    docstring   first line: the result that is shown; then the source, and why the comparison is fair
    ``RUNS``    default number of runs
    ``SEED``    default seed of its random numbers; the same seed gives the same results
    ``study(runs, seed, progress) -> [StudyResult]``   it calls ``progress`` with the completed share, 0 to 1

and optionally

    ``drawings(seed) -> {name: draw}``   figures by name; each is computed and drawn when its ``draw()`` is called, in
                                         the look of ``fti.plot_style``
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from fti.errors import MissingError
from fti.parallel_runs import Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Draws one figure.
DrawFigure = Callable[[], "Figure"]

#: Target of a result that is reported and not judged.
REPORTED = "reported"


@dataclass(frozen=True, slots=True)
class StudyResult:
    """One quantity.  id : of the target; value : result; target : as text; holds : the target is met."""

    id: str
    quantity: str
    value: float | int
    target: str
    holds: bool


class Study(Protocol):
    """Interface of a study module."""

    RUNS: int
    SEED: int

    def study(self, runs: int, seed: int, progress: Progress) -> list[StudyResult]:
        """Run the study."""


@runtime_checkable
class PlottedStudy(Study, Protocol):
    """A study with figures."""

    def drawings(self, seed: int) -> dict[str, DrawFigure]:
        """Functions that draw the figures, by figure name."""


def names() -> list[str]:
    """Names of all studies, sorted."""
    return sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))


def load(name: str) -> Study:
    """The study of that name, written with ``-`` or ``_``.  Raises MissingError that lists the studies."""
    module_name = name.replace("-", "_")
    if module_name not in names():
        raise MissingError(f"no study {name!r}; there are {', '.join(names())}")
    module: Study = importlib.import_module(f"{__name__}.{module_name}")
    return module


def name_of(study: Study) -> str:
    """Its name."""
    return str(vars(study)["__name__"]).rpartition(".")[2]


def title(study: Study) -> str:
    """First line of its docstring."""
    return (inspect.getdoc(study) or "").partition("\n")[0]
