"""The corrected time base of a session: for every clock its reading over FTI time, piecewise linear.

Raw timestamps are not changed; to convert one to GNSS, device or real time, interpolate between two rows of the same
clock and segment.  A segment of up to an hour is one line.  A longer one varies with temperature: it has a row every
ten minutes, each from the fit of the hour around it.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import itertools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import Writer

from fti.constants import SECOND_NS
from fti.errors import ConfigError, StorageError
from fti.logger import schemas
from fti.nav.device_time.clock_estimator import ClockSegment
from fti.nav.device_time.delay_envelope import EnvelopeLine, fit_line
from fti.new_file import write_new_file
from fti.post.sync import ComputerClock, DeviceClockSeries, Sync

HOUR_NS = 3600 * SECOND_NS
STEP_NS = 600 * SECOND_NS
TOPIC = "/fti/time_base"
SUFFIXES = (".csv", ".mcap")


@dataclass(frozen=True, slots=True)
class TimeBaseRow:
    """At the FTI time t_fti_ns the clock showed clock_ns, with a 1-sigma of sd_ns.

    device  : of the configuration, or "computer" for its real-time clock; link : its link
    scale   : gps | utc | boot, see ``TimeScale``; a counter that wraps is unwrapped
    segment : interpolate only between rows of one segment, from 0
    """

    device: str
    link: str
    scale: str
    segment: int
    t_fti_ns: int
    clock_ns: int
    sd_ns: int


def time_base(sync: Sync) -> list[TimeBaseRow]:
    """All rows, clock by clock, in order of time."""
    rows = [row for clock_series in sync.clock_series for row in _device_rows(clock_series)]
    return rows + list(_computer_rows(sync.computer))


def _device_rows(clock_series: DeviceClockSeries) -> Iterator[TimeBaseRow]:
    clock, device = clock_series.clock, clock_series.device
    latency_ns = round(device.latency_ms * 1e6)
    for number, segment in enumerate(s for s in clock.segments if s.is_known):
        for t_ns, line in _lines(segment):
            shown_ns = segment.device_ns(t_ns + latency_ns, line)
            row = (t_ns, shown_ns, round(segment.sd_ns(shown_ns, line)))
            yield TimeBaseRow(device.name, device.link, clock_series.scale, number, *row)


def _lines(segment: ClockSegment) -> Iterator[tuple[int, EnvelopeLine]]:
    """The times of the rows of a segment, and the line at each time."""
    first, last = segment.first_ns, segment.last_ns
    if last - first <= HOUR_NS:
        yield first, segment.line
        yield last, segment.line
        return
    x, y = segment.points
    for t_ns in (*range(first, last, STEP_NS), last):
        middle = min(max(t_ns, first + HOUR_NS // 2), last - HOUR_NS // 2)
        begin, end = np.searchsorted(x, [middle - first - HOUR_NS // 2, middle - first + HOUR_NS // 2])
        yield t_ns, fit_line(x[begin:end], y[begin:end], float(segment.resolution_ns)) or segment.line


def _computer_rows(clock: ComputerClock) -> Iterator[TimeBaseRow]:
    """The real-time clock at the start, before and after each step, and at the end."""
    if len(clock.t) == 0:
        return
    step_indices = np.searchsorted(clock.t, [t_ns for t_ns, _ in clock.steps])
    bounds = [0, *map(int, step_indices), len(clock.t)]
    for number, (begin, end) in enumerate(itertools.pairwise(bounds)):
        for i in dict.fromkeys((begin, end - 1)):
            shown = (int(clock.t[i]), int(clock.realtime[i]), int(clock.width[i]))
            yield TimeBaseRow("computer", "", "utc", number, *shown)


# -------------------------------------------------------------------------------------------------------- writing


def check_output_path(path: Path) -> None:
    """Raises ConfigError for another suffix, StorageError when the file exists, or its folder does not."""
    if path.suffix not in SUFFIXES:
        raise ConfigError(f"{path}: must end with {' or '.join(SUFFIXES)}")
    if not path.parent.is_dir():
        raise StorageError(f"{path}: cannot be written: no folder {path.parent}")
    for file in (path, _metadata_path(path)):
        if file.exists():
            raise StorageError(f"{file}: already exists; choose another name")


def _metadata_path(path: Path) -> Path:
    """The file with the session metadata of a table."""
    return path.with_suffix(".json") if path.suffix == ".csv" else path


def write(sync: Sync, path: Path) -> None:
    """Write the rows to a new ``.csv`` or ``.mcap`` file, with the session metadata (for CSV in a file beside it).

    Raises as ``check_output_path``, and StorageError when it cannot be written.
    """
    check_output_path(path)
    rows = time_base(sync)
    if path.suffix == ".mcap":
        write_new_file(path, _mcap(rows, sync.session_metadata))
        return
    write_new_file(_metadata_path(path), f"{json.dumps(dict(sync.session_metadata), indent=1)}\n".encode())
    write_new_file(path, _csv(rows))


def _csv(rows: list[TimeBaseRow]) -> bytes:
    names = [field.name for field in dataclasses.fields(TimeBaseRow)]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(names)
    table.writerows([getattr(row, name) for name in names] for row in rows)
    return text.getvalue().encode()


def _mcap(rows: list[TimeBaseRow], session_metadata: Mapping[str, str]) -> bytes:
    file = io.BytesIO()
    writer = Writer(file)
    writer.start(profile="fti", library="fti")
    writer.add_metadata("fti", dict(session_metadata))
    schema = schemas.schema_of(TimeBaseRow)
    schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
    channel = writer.register_channel(TOPIC, "json", schema_id)
    for row in sorted(rows, key=lambda row: row.t_fti_ns):
        data = json.dumps(dataclasses.asdict(row), separators=(",", ":")).encode()
        writer.add_message(channel, row.t_fti_ns, data, row.t_fti_ns)
    writer.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()
