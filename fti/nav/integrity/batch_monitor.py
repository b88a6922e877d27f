"""Evaluates all windows of an approach as ``ClearanceMonitor`` would, for thousands of approaches.

Only for approaches with all samples usable and continuous progress, as on every nominal one.  Updates, bins and
statistics are those of the monitor (the same kernels; a test compares them window by window).  Without a statistic over
its limit there is no ALERT and no CAUTION, so that the alarm logic is needed for the other approaches only.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.config import Approach
from fti.kernel import kernel
from fti.nav.integrity.monitor import ClearanceMonitor
from fti.nav.integrity.reference import ApproachReference
from fti.nav.integrity.statistics import MatchReference, match, match_reference
from fti.nav.integrity.window import MIN_FILLED_SHARE, ClearanceSeries, add_samples, means

COLUMNS = 8


@dataclass(frozen=True, eq=False)
class WindowBatch:
    """The evaluated windows of an approach, shape (n,) each.

    s : where the window ends [m]        t1..t4, observability, shift_resolution, height_error_sd : as in ``Statistics``
    """

    s: Array
    t1: Array
    t2: Array
    t3: Array
    t4: Array
    observability: Array
    shift_resolution: Array
    height_error_sd: Array


class BatchMonitor:
    """Evaluates approaches with a reference, as the monitor with these settings would."""

    def __init__(self, reference: ApproachReference, settings: Approach) -> None:
        monitor = ClearanceMonitor(reference, settings)
        self._bounds, self._agl_ref = monitor.bounds, monitor.agl_ref
        self._reference = match_reference(reference, settings.alert_s_m)
        self._extent = float(reference.s[0]), float(reference.header.profile.window_m)

    def scan(self, track: ClearanceSeries, vertical_sd: float) -> WindowBatch | None:
        """The windows of an approach; None where a sample violates a rule or bins are empty: use the monitor."""
        outside = np.flatnonzero(track.s > self._bounds[0])
        begin = int(outside[-1]) + 1 if len(outside) else 0  # the monitor begins again after each of them
        every = (track.s, track.y, track.alt, track.agl, track.roll, track.pitch, track.climb)
        columns = tuple(column[begin:] for column in every)
        table, plain = _scan(
            track.t_ns[begin:],
            columns,
            self._bounds,
            self._agl_ref,
            self._extent,
            self._reference,
            vertical_sd,
        )
        return WindowBatch(*np.ascontiguousarray(table.T)) if plain else None


@kernel
def _scan(
    t_ns: NDArray[np.int64],
    columns: tuple[Array, ...],
    bounds: Array,
    agl_ref: Array,
    extent: tuple[float, float],
    reference: MatchReference,
    vertical_sd: float,
) -> tuple[Array, bool]:
    """A row for each evaluated window, and whether all samples up to the intercept point were usable.

    extent : path length at the first bin of the reference, and length of a window [m]
    """
    (s0, length), ds, span = extent, reference.ds, reference.span
    size, bins = round(length / ds) + 1, len(reference.z)
    count, z, dh = np.zeros(bins), np.zeros(bins), np.zeros(bins)
    curves, peak, table = np.empty((2, 2 * span + 1)), np.empty((2, 4)), np.empty((len(t_ns), COLUMNS))
    ss, rows, first_s, min_s, begin = columns[0], 0, columns[0][0], columns[0][0], 0
    updated = (t_ns[0] - np.int64(10**12), first_s + 1e9)  # the first sample is due
    while begin < len(t_ns):
        due, min_s = add_samples(t_ns, columns, begin, bounds, updated, agl_ref, (count, z, dh), (s0, ds, min_s))
        if due == len(t_ns) or ss[due] < 0.0:
            return table[:rows], True
        # the due sample itself is added like any other: no update is due at it again
        taken, min_s = add_samples(
            t_ns[: due + 1], columns, due, bounds, (t_ns[due], ss[due]), agl_ref, (count, z, dh), (s0, ds, min_s)
        )
        if taken == due:
            return table[:rows], False
        updated, begin = (t_ns[due], ss[due]), due + 1
        if first_s - ss[due] < length:
            continue
        first = round((ss[due] - s0) / ds)
        filled, mean_z, _ = means(count, z, dh, first, size)
        number = np.count_nonzero(filled)
        if number < MIN_FILLED_SHARE * size:
            return table[:rows], False
        total, t4 = match(mean_z, filled, first, reference, curves, peak)
        height_error_sd = math.sqrt(vertical_sd**2 + reference.datum_sd**2 + number / reference.k_eff / total)
        bend = peak[1, 2] + peak[1, 3]
        table[rows, 0] = ss[due]
        table[rows, 1] = curves[1, span]
        table[rows, 2] = curves[1, span] - curves[1].min()
        table[rows, 3] = abs(curves[0, span]) / height_error_sd
        table[rows, 4] = t4
        table[rows, 5] = min(peak[1, 0], peak[1, 1])
        table[rows, 6] = ds * math.sqrt(2.0 / bend) if bend > 0.0 else math.inf
        table[rows, 7] = height_error_sd
        rows += 1
    return table[:rows], True
