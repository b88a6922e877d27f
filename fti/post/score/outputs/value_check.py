"""Compares the decoded measurements of a device with its intended values.

The truth file has intended values once a second.  The recording may have skipped that sample, so each value must be
within the range of the values decoded within half a second of it, extended by their scatter and by the stated sigma,
which includes the resolution of the protocol.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array, Ints
from fti.hil.oracle.output_effects import Interval, interval_mask
from fti.hil.tables.quantity_names import NAME_FIELDS
from fti.hil.truth_log import MEASUREMENT
from fti.logger.reading.json_message import parse_table, using_message
from fti.logger.reading.mcap_file import McapFile
from fti.post.score.outputs.row import OutputCheck, OutputRow, result_of
from fti.post.score.series import TopicSeries

#: Decoded samples within this time of the intended value are compared with it [ns].
MATCH_WINDOW_NS = 500_000_000
#: Tolerances: multiples of the scatter of some five samples, shares of the span over the flight and of the value.
SCATTERS, OF_SPAN, OF_VALUE, MIN_TOLERANCE = 5.0, 0.02, 0.005, 1e-6
#: Further tolerance: multiples of the stated sigma, limited to a share of the value.
SIGMAS, MAX_SIGMA_SHARE = 3.0, 0.05
#: Shares of the value where protocols send small numbers with one decimal place.
COARSE = {"hdop": 0.1, "vdop": 0.1, "pdop": 0.1}
#: Minimum share of the values that must be decoded; one may always be missing.
FOUND_SHARE = 0.9
MIN_COUNT = 5
#: Circular angles [rad].
CIRCULAR = ("heading", "track", "lon")

#: Of one device: name of the number -> times [ns] and values.
IntendedValues = Mapping[str, tuple[Ints, Array]]


def read_intended_values(truth_file: Path) -> dict[str, IntendedValues]:
    """The intended values of each device, by its name; empty in older truth files.  Raises RecordingError."""
    rows: dict[str, dict[str, list[tuple[int, float]]]] = defaultdict(lambda: defaultdict(list))
    for item in McapFile(truth_file).items():
        if item.topic.name.startswith(MEASUREMENT):
            with using_message(item.topic.name, item.log_time):
                for name, value in parse_table(item.data)["values"].items():
                    rows[item.topic.name.removeprefix(MEASUREMENT)][name].append((item.log_time, float(value)))
    return {device: {name: _columns(pairs) for name, pairs in of.items()} for device, of in rows.items()}


def _columns(pairs: Sequence[tuple[int, float]]) -> tuple[Ints, Array]:
    times, values = zip(*pairs, strict=True)
    return np.array(times, dtype=np.int64), np.array(values)


def value_rows(
    series: TopicSeries, intended: IntendedValues, flight: Interval, exempt: Sequence[Interval], begin_ns: int
) -> Iterator[OutputRow]:
    """A row for each number of one kind of measurement.

    exempt : faults, and lateness of the emulator [s of the flight]; begin_ns : FTI time of the begin of the flight
    """
    kind = series.topic.rpartition("/")[2]
    parts: dict[str, TopicSeries] = {}
    for name, (times, values) in intended.items():
        of_kind, _, field = name.rpartition(".")
        if _kind_of(name) != kind:
            continue
        part = parts.setdefault(of_kind, _select_label(series, of_kind))
        t = (times - begin_ns) / 1e9
        is_due = (t >= flight[0] + 1.0) & (t <= flight[1] - 1.0) & ~interval_mask(t, exempt)
        if np.count_nonzero(is_due) >= MIN_COUNT:
            due = (times[is_due], values[is_due])
            yield _row(series.topic, name, _decoded_values(part, field), due, begin_ns, sd=_stated_sd(part))


def unsent_intervals(intended: IntendedValues, kind: str, begin_ns: int) -> Iterator[Interval]:
    """Intervals in which the device sent other kinds of measurements, and not this one [s of the flight].

    None where the kind has no numbers: then the truth has no times of it.
    """
    stated = {t for name, (times, _) in intended.items() if _kind_of(name) == kind for t in times.tolist()}
    every = sorted({t for times, _ in intended.values() for t in times.tolist()})
    for i, t_ns in enumerate(every):
        if stated and t_ns not in stated:
            before, after = every[max(i - 1, 0)], every[min(i + 1, len(every) - 1)]
            yield (before - begin_ns) / 1e9, (after - begin_ns) / 1e9


def _kind_of(name: str) -> str:
    return name.rpartition(".")[0].partition("[")[0]


def _select_label(series: TopicSeries, of_kind: str) -> TopicSeries:
    """The messages of one named value, surface or station; all where the kind has no names."""
    label = of_kind.partition("[")[2].rstrip("]")
    if not label:
        return series
    return series.pick(
        np.array([label in (row.get(field) for field in NAME_FIELDS) for row in series.rows], dtype=bool)
    )


def _row(
    topic: str, name: str, decoded: tuple[Ints, Array], intended: tuple[Ints, Array], begin_ns: int, *, sd: float
) -> OutputRow:
    """decoded, intended : times [ns] and values; sd : 1-sigma of the values"""
    times = intended[0]
    field = name.rpartition(".")[2]
    missing = _find_missing(decoded, intended, (COARSE.get(field, OF_VALUE), sd), circular=field in CIRCULAR)
    count = int(np.count_nonzero(missing))
    return OutputRow(
        topic,
        OutputCheck.MEASURED,
        name,
        result_of(count <= max(1.0, (1.0 - FOUND_SHARE) * len(times))),
        f"{len(times) - count} of {len(times)} intended values decoded",
        f">= {FOUND_SHARE:.0%}, or all but one",
        float(times[int(np.argmax(missing))] - begin_ns) / 1e9 if count else None,
    )


def _decoded_values(part: TopicSeries, field: str) -> tuple[Ints, Array]:
    """Ints [ns] and numbers of a field in valid messages, in order of time."""
    values, times = _component(part, field), part.valid_ns
    known = np.isfinite(values) & part.valid
    order = np.argsort(times[known], kind="stable")
    return times[known][order], values[known][order]


def _stated_sd(part: TopicSeries) -> float:
    """The median of the stated sigmas; 0 where none is stated."""
    sd = part.column("sd")
    return float(np.median(sd[np.isfinite(sd)])) if np.isfinite(sd).any() else 0.0


def _component(part: TopicSeries, field: str) -> Array:
    """A field, or one component of a vector: ``gyro_b_2``."""
    base, _, index = field.rpartition("_")
    if not index.isdigit():
        return part.column(field)
    vectors = part.values(base)
    return np.array([_entry(vector, int(index)) for vector in vectors], dtype=np.float64)


def _entry(vector: object, index: int) -> float:
    if not isinstance(vector, list) or len(vector) <= index or not isinstance(vector[index], int | float):
        return math.nan
    return float(vector[index])


def _find_missing(
    decoded: tuple[Ints, Array], intended: tuple[Ints, Array], of_value_sd: tuple[float, float], *, circular: bool
) -> NDArray[np.bool_]:
    """Intended values without a matching decoded value, shape (n,)."""
    (at, found), (times, values), (of_value, sd) = decoded, intended, of_value_sd
    widths = (
        OF_SPAN * float(np.ptp(np.unwrap(values) if circular else values)) + of_value * np.abs(values) + MIN_TOLERANCE
    )
    widths += np.minimum(SIGMAS * sd, MAX_SIGMA_SHARE * np.abs(values))
    first, beyond = (
        np.searchsorted(at, times - MATCH_WINDOW_NS, "left"),
        np.searchsorted(at, times + MATCH_WINDOW_NS, "right"),
    )
    missing = np.ones(len(times), dtype=bool)
    for i, (begin, end) in enumerate(zip(first, beyond, strict=True)):
        if end > begin:
            difference = found[begin:end] - values[i]
            if circular:
                difference = (difference + math.pi) % (2.0 * math.pi) - math.pi
            width = SCATTERS * float(np.std(difference)) + float(widths[i])
            missing[i] = not (difference.min() - width <= 0.0 <= difference.max() + width)
    return missing
