"""Studies: a published result again, each with its target beside what was found.

A study is a module or package of this package whose name does not begin with ``_``, except ``HELPERS``.  A study has:

    docstring   first line: what is shown; then the source, and how the comparison is fair
    ``RUNS``    how many runs it takes unless told otherwise
    ``SEED``    seed of its random numbers unless told otherwise; the same seed gives the same results
    ``study(runs, seed, progress) -> [Result]``   progress is told the share that is done, 0 to 1

and, where there is something to see,

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

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Told the share that is done, 0 to 1.
Progress = Callable[[float], None]
#: Draws one figure.
DrawFigure = Callable[[], "Figure"]


#: Modules that studies share.
HELPERS = {"workers"}
#: Target of a result that is told and not judged.
REPORTED = "reported"


@dataclass(frozen=True, slots=True)
class StudyResult:
    """One quantity.  id : of the target; value : found; target : in words; holds : the target is reached."""

    id: str
    quantity: str
    value: float | int
    target: str
    holds: bool


class Study(Protocol):
    """What a study module offers."""

    RUNS: int
    SEED: int

    def study(self, runs: int, seed: int, progress: Progress) -> list[StudyResult]:
        """Do it."""


@runtime_checkable
class PlottedStudy(Study, Protocol):
    """A study with figures."""

    def drawings(self, seed: int) -> dict[str, DrawFigure]:
        """What draws each figure, by its name."""


def names() -> list[str]:
    """Names of the studies there are, sorted."""
    modules = (m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))
    return sorted(set(modules) - HELPERS)


def load(name: str) -> Study:
    """The study of that name, written with ``-`` or ``_``.  Raises MissingError naming those that exist."""
    wanted = name.replace("-", "_")
    if wanted not in names():
        raise MissingError(f"no study {name!r}; there are {', '.join(names())}")
    module: Study = importlib.import_module(f"{__name__}.{wanted}")
    return module


def name_of(study: Study) -> str:
    """Its name."""
    return str(vars(study)["__name__"]).rpartition(".")[2]


def title(study: Study) -> str:
    """First line of its docstring."""
    return (inspect.getdoc(study) or "").partition("\n")[0]
