"""The queue in front of the derived file: what waits is what the file keeps, and it is bounded."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.logger.reading.recording import Recording
from fti.logger.storage_target import StorageTarget
from fti.messages.measurements import Measurement, PointArrays, RadioHeight, Stamp
from fti.ranging.scan_points import make_scan, point_arrays
from fti.service.navigation import derived_writer
from fti.service.navigation.derived_writer import DerivedWriter

START_NS = 1_700_000_000_000_000_000


def _writer(folder: Path) -> DerivedWriter:
    log = DerivedLog(None, LogSettings(split_s=300, split_mb=100, folders=[folder]))
    return DerivedWriter(log, [StorageTarget.of(str(folder))], 0, lambda unit, error: None)


def _feed(writer: DerivedWriter, count: int, rate_hz: int) -> None:
    for i in range(count):
        stamp = Stamp(START_NS + i * 10**9 // rate_hz)
        writer.measurement("radar", RadioHeight(stamp=stamp, height_agl=float(i)))


def _written(folder: Path) -> list[int]:
    return [(t_ns - START_NS) // 1_000_000 for _, t_ns, *_ in Recording.open(folder).messages("/radar/")]


def test_what_the_file_leaves_out_does_not_wait(tmp_path: Path) -> None:
    writer = _writer(tmp_path)
    _feed(writer, 4000, 400)
    waiting = len(writer._waiting)
    writer.start()
    writer.close()
    written = _written(tmp_path)
    assert waiting == len(written) == pytest.approx(250, abs=2)  # 10 s at 25 Hz
    assert written[-1] > 9900
    assert writer.lost == 0


def test_of_what_waits_too_long_the_oldest_goes_and_is_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(derived_writer, "MAX_QUEUED", 20)
    writer = _writer(tmp_path)
    _feed(writer, 100, 25)
    assert (len(writer._waiting), writer.lost) == (20, 80)
    writer.start()
    writer.close()
    assert _written(tmp_path) == [40 * i for i in range(80, 100)]


def test_points_of_a_scan_do_not_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A minute of a scanner would be hundreds of megabytes; the file has a summary of them only."""
    writer = _writer(tmp_path)
    written: list[Measurement] = []
    monkeypatch.setattr(writer._log, "write_undecimated", lambda device, measurement: written.append(measurement))
    scan = make_scan(Stamp(START_NS), [3.0, 4.0], point_arrays([(0.0, 0.0, 1.0)] * 2, [0.0, 0.0]))
    writer.measurement("scanner", scan)
    for write in writer._waiting:
        write()
    assert written == [replace(scan, arrays=PointArrays())]
