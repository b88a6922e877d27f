"""Messages and truths that are made for one test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fti.post.score.series import TopicSeries
from fti.post.score.truth_table import TruthTable

BEGIN_NS = 1_767_225_600_000_000_000
SECOND_NS = 1_000_000_000


def stamp_ns(t: ArrayLike) -> Any:
    """FTI times of seconds of the flight [ns]."""
    return BEGIN_NS + np.rint(SECOND_NS * np.asarray(t, dtype=np.float64)).astype(np.int64)


def messages(topic: str, t: Sequence[float], *, repeated: int = 0, **columns: Any) -> TopicSeries:
    """Messages at some seconds of the flight; a column is one value for all, or one for each."""
    times = stamp_ns(t).tolist()
    rows: list[dict[str, Any]] = [{"t_ns": t_ns, "t_valid_ns": t_ns, "valid": True} for t_ns in times]
    for name, values in columns.items():
        several = values if isinstance(values, list | np.ndarray) else [values] * len(rows)
        for row, value in zip(rows, several, strict=True):
            row[name] = value.item() if isinstance(value, np.generic) else value
    return TopicSeries(topic, np.array(times, dtype=np.int64), rows, repeated)


def truth(until_s: float, **columns: float | Sequence[float]) -> TruthTable:
    """Rows at 25 Hz; a column is one value, or the values at the beginning and at the end."""
    t = np.arange(0.0, until_s + 0.02, 0.04)
    content: Mapping[str, Any] = {
        name: np.interp(t, (0.0, until_s), np.broadcast_to(np.asarray(values, dtype=np.float64), 2))
        for name, values in columns.items()
    }
    return TruthTable(stamp_ns(t), content)
