"""Studies: a published result again, each with its target beside what was found.

A study is a module of this package whose name does not begin with ``_``.  It has:

    docstring   first line: what is shown; then the source, and how the comparison is fair
    ``RUNS``    how many runs it takes unless told otherwise
    ``SEED``    seed of its random numbers unless told otherwise; the same seed gives the same results
    ``study(runs, seed, progress) -> [Result]``   progress is told the share that is done, 0 to 1
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from fti.errors import MissingError

#: Told the share that is done, 0 to 1.
Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Result:
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

    def study(self, runs: int, seed: int, progress: Progress) -> list[Result]:
        """Do it."""


def names() -> list[str]:
    """Names of the studies there are, sorted."""
    return sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))


def load(name: str) -> Study:
    """The study of that name.  Raises MissingError naming those that exist."""
    if name not in names():
        raise MissingError(f"no study {name!r}; there are {', '.join(names())}")
    module: Study = importlib.import_module(f"{__name__}.{name}")
    return module


def title(study: Study) -> str:
    """First line of its docstring."""
    return (inspect.getdoc(study) or "").partition("\n")[0]
