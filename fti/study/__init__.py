"""Studies: each reproduces a published result and compares it with a target.

A study is a package of this package.  Its modules depend in one direction, judge -> experiment <- plots, without
circles (tests/test_layers.py):

    ``experiment``   computes, with the modules beside it; it has no targets and no figures
    ``judge``        compares with the targets
    ``plots``        draws

The package itself is what ``fti study`` runs:

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

    @classmethod
    def reported(cls, name: str, quantity: str, value: float) -> StudyResult:
        """A quantity that is not judged."""
        return cls(name, quantity, value, REPORTED, holds=True)

    @classmethod
    def at_least(cls, name: str, quantity: str, value: float, minimum: float) -> StudyResult:
        """Judged by a minimum."""
        return cls(name, quantity, value, f">= {minimum:g}", bool(value >= minimum))

    @classmethod
    def at_most(cls, name: str, quantity: str, value: float, maximum: float) -> StudyResult:
        """Judged by a maximum."""
        return cls(name, quantity, value, f"<= {maximum:g}", bool(value <= maximum))


class Study(Protocol):
    """Interface of a study package."""

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
    return sorted(module.name for module in pkgutil.iter_modules(__path__) if module.ispkg)


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


def describe(study: Study) -> str:
    """Its docstring, number of runs and seed."""
    return f"{inspect.getdoc(study)}\n\nDefault: {study.RUNS} runs, seed {study.SEED}."
