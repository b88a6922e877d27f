"""``fti export``: tables with units, whole or not there."""

import csv
import io
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from fti.cli.main import main
from fti.errors import StorageError
from fti.logger.export import csv_table
from fti.logger.export.columns import Column, ColumnFinder, Type, flatten
from fti.logger.log_layout import LogLayout, LogSettings
from fti.logger.reading.recording import Recording
from fti.logger.schemas import Schema
from fti.logger.session import SessionFolder
from fti.logger.split_log import SplitLog
from tests.cli.sessions import SECOND, STARTED, make_folder, mark, record_derived, record_raw, record_snapshots
from tests.helpers import until


@pytest.fixture
def folder(tmp_path: Path) -> SessionFolder:
    session = make_folder(tmp_path)
    log = record_raw(session, range(300))
    log.write_sent("radar", 300, STARTED + 6 * SECOND, b"ask")
    mark(log, 3.0, "flare, 2nd")
    log.close()
    record_derived(session)
    return session


def export(folder: SessionFolder, out: Path, *arguments: str) -> int:
    return main(["export", str(folder.path), "--out", str(out), *arguments])


def read_table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_csv_has_units_in_its_heads(folder: SessionFolder, tmp_path: Path) -> None:
    out = tmp_path / "deep" / "tables"
    assert export(folder, out, "--raw") == 0
    assert sorted(p.name for p in out.iterdir()) == [
        "fti_event.csv", "imu_imu_sample.csv", "ins_attitude.csv", "nav_glide_slope.csv",
        "raw_ins.csv", "raw_radar.csv", "session.json", "tx_radar.csv",
    ]  # fmt: skip
    imu = read_table(out / "imu_imu_sample.csv")
    assert [row["accel_b.2 [m/s^2]"] for row in imu] == ["", "9.81"] and "accel_b" not in imu[0]
    assert imu[1]["stamp.t_rx_ns"] == imu[1]["log_time_ns"] == str(STARTED + SECOND) and imu[1]["t_s"] == "1.0"
    slope = read_table(out / "nav_glide_slope.csv")[0]
    assert (slope["reasons"], slope["deviation [rad]"], slope["sd [rad]"]) == ("roll stale", "0.001", "")
    raw = read_table(out / "raw_ins.csv")
    assert len(raw) == 150
    first = {"seq": "1", "t_rx_ns": str(STARTED + SECOND // 50), "t_s": "0.02", "utc": "2026-01-02T03:04:05.020000000Z"}
    assert raw[0] == {**first, "length [B]": "10", "data": "00" * 10}
    assert [row["data"] for row in read_table(out / "tx_radar.csv")] == [b"ask".hex()]
    assert [row["message"] for row in read_table(out / "fti_event.csv")] == ["flare, 2nd"]


def test_rows_of_health_hold_what_a_record_left_out(tmp_path: Path) -> None:
    folder = make_folder(tmp_path)
    log = record_raw(folder, range(0))
    for n in range(12):
        links = {
            "quiet": {"state": "silent", "age_ms": 1000.0 * n},
            "busy": {"state": "good", "age_ms": 1.0, "frames": n},
        }
        log.write_json(
            "/fti/health", STARTED + n * SECOND, {"t_ns": STARTED + n * SECOND, "links": links, "devices": {}}
        )
    log.close()
    is_paused = [json.loads(data) for *_, data in Recording.open(folder.path).messages("/fti/health", kind="raw")]
    assert sum("quiet" in record["links"] for record in is_paused) == 2
    assert export(folder, tmp_path / "all") == 0
    rows = read_table(tmp_path / "all" / "fti_health.csv")
    assert [row["links.quiet.state"] for row in rows] == ["silent"] * 12
    assert [float(row["links.quiet.age_ms"]) for row in rows] == [1000.0 * n for n in range(12)]
    assert [row["links.busy.frames"] for row in rows] == [str(n) for n in range(12)]
    assert not {"complete", "since_ns"} & set(rows[0])
    assert export(folder, tmp_path / "part", "--from", "4", "--to", "6") == 0
    part = read_table(tmp_path / "part" / "fti_health.csv")
    assert [row["links.quiet.state"] for row in part] == ["silent"] * 3


def test_parquet_has_types_units_and_nulls(folder: SessionFolder, tmp_path: Path) -> None:
    assert export(folder, tmp_path / "t", "--raw", "--format", "parquet") == 0
    imu = pq.read_table(tmp_path / "t" / "imu_imu_sample.parquet")
    assert imu.column("accel_b.2").to_pylist() == [None, 9.81]
    assert imu.column("stamp.t_rx_ns").to_pylist() == [STARTED, STARTED + SECOND]
    field = imu.schema.field("accel_b.2")
    assert (str(field.type), field.metadata) == ("double", {b"unit": b"m/s^2"})
    assert json.loads(imu.schema.metadata[b"units"])["accel_b.2"] == "m/s^2"
    slope = pq.read_table(tmp_path / "t" / "nav_glide_slope.parquet")
    assert slope.column("reasons").to_pylist() == [["roll", "stale"]]
    assert slope.column("valid").to_pylist() == [False]
    assert [str(slope.schema.field(name).type) for name in ("valid", "t_ns", "sd")] == ["bool", "int64", "double"]
    raw = pq.read_table(tmp_path / "t" / "raw_radar.parquet")
    assert raw.column("data").to_pylist() == [bytes(10)] * 150
    assert raw.column("seq").to_pylist() == list(range(0, 300, 2))


def test_parquet_comes_in_groups_that_lose_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fti.logger.export import parquet_table

    monkeypatch.setattr(parquet_table, "GROUP_ROWS", 7)
    table = parquet_table.ParquetTable(tmp_path / "t", [Column("n", Type.INT)], {})
    for n in range(30):
        table.write([n])
    table.close()
    file = pq.ParquetFile(tmp_path / "t")
    assert file.num_row_groups == 5 and file.read().column("n").to_pylist() == list(range(30))


def test_topics_and_times_are_chosen(folder: SessionFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert export(folder, tmp_path / "a", "--topic", "/nav/*", "--topic", "/imu/*") == 0
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == [
        "imu_imu_sample.csv",
        "nav_glide_slope.csv",
        "session.json",
    ]
    assert export(folder, tmp_path / "b", "--raw", "--topic", "/raw/ins", "--from", "2", "--to", "3") == 0
    times = [float(row["t_s"]) for row in read_table(tmp_path / "b" / "raw_ins.csv")]
    assert (len(times), min(times), max(times)) == (25, 2.02, 2.98)
    capsys.readouterr()
    assert export(folder, tmp_path / "c", "--topic", "/inz/*") == 2
    found = capsys.readouterr().err.splitlines()[-1]
    assert found.startswith("fti: --topic /inz/*: matches nothing; topics: /fti/event, /imu/imu_sample, ")
    assert "(with --raw also those" in found
    assert export(folder, tmp_path / "c", "--from", "3", "--to", "2") == 2
    assert "--to 2: must not be before --from 3" in capsys.readouterr().err


def test_a_session_in_several_folders_is_exported_as_one(
    folder: SessionFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spare = tmp_path / "spare" / folder.name
    spare.mkdir(parents=True)
    moved = folder.files("raw")[0]
    moved.rename(spare / moved.name)
    assert export(folder, tmp_path / "part", "--raw", "--topic", "/raw/ins") == 0
    assert main(["export", str(folder.path), str(spare), "--out", str(tmp_path / "t"), "--raw"]) == 0
    assert [int(row["seq"]) for row in read_table(tmp_path / "t" / "raw_ins.csv")] == list(range(1, 300, 2))
    assert len(read_table(tmp_path / "part" / "raw_ins.csv")) < 150


# ------------------------------------------------------------------------------------------- of which session it is


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_tables_of_a_snapshot_report_it(form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session, out = make_folder(tmp_path), tmp_path / "t"
    record_snapshots(session, range(50, 100), range(200, 230))
    assert export(session, out, "--raw", "--format", form) == 0
    assert capsys.readouterr().err.startswith("note: SNAPSHOT: not a continuous recording")
    session_metadata = json.loads((out / "session.json").read_text())
    assert (session_metadata["session"], session_metadata["origin"], session_metadata["mode"]) == (
        session.name,
        "hil",
        "snapshot",
    )
    assert session_metadata["note"].startswith("SNAPSHOT: not a continuous recording")
    if form == "csv":
        seqs = [int(row["seq"]) for row in read_table(out / "raw_ins.csv")]
    else:
        table = pq.read_table(out / "raw_ins.parquet")
        seqs = table.column("seq").to_pylist()
        assert {
            key.encode(): text.encode() for key, text in session_metadata.items()
        }.items() <= table.schema.metadata.items()
    assert seqs == [*range(51, 100, 2), *range(201, 230, 2)]


def test_a_continuous_session_has_no_such_note(
    folder: SessionFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert export(folder, tmp_path / "t", "--topic", "/nav/*") == 0
    assert export(folder, tmp_path / "t", "--topic", "/imu/*") == 0  # more of the same session
    assert "SNAPSHOT" not in capsys.readouterr().err
    assert "note" not in json.loads((tmp_path / "t" / "session.json").read_text())


def test_tables_of_two_sessions_are_not_mixed(
    folder: SessionFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert export(folder, tmp_path / "t", "--topic", "/nav/*") == 0
    other = SessionFolder.create(tmp_path, "other", STARTED)
    record_raw(other, range(10)).close()
    assert export(other, tmp_path / "t", "--raw") == 2
    assert "session.json: the tables in this folder belong to another session" in capsys.readouterr().err
    assert sorted(p.name for p in (tmp_path / "t").iterdir()) == ["nav_glide_slope.csv", "session.json"]


def test_nothing_is_overwritten(folder: SessionFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    existing = tmp_path / "t" / "nav_glide_slope.csv"
    existing.parent.mkdir()
    existing.write_text("mine")
    assert export(folder, existing.parent) == 2
    assert "nav_glide_slope.csv: cannot be written: it exists already" in capsys.readouterr().err
    assert list(existing.parent.iterdir()) == [existing] and existing.read_text() == "mine"


class FullTable(csv_table.CsvTable):
    """A table on a medium that takes only so many rows."""

    left = 5

    def write(self, row: Any) -> None:
        FullTable.left -= 1
        if FullTable.left < 0:
            raise OSError(28, "No space left on device")
        super().write(row)


def test_a_full_medium_leaves_no_half_table(folder: SessionFolder, tmp_path: Path) -> None:
    from fti.logger.export.selection import ExportSelection
    from fti.logger.export.table_files import Format
    from fti.logger.export.tables import export
    from fti.logger.reading.recording import Recording

    with pytest.raises(StorageError, match=r"raw_\w+.csv: cannot be written: No space left on device"):
        export(Recording.open(folder.path), tmp_path / "t", Format(".csv", FullTable), ExportSelection(raw=True))
    assert list((tmp_path / "t").iterdir()) == []


def test_a_full_medium_of_the_waiting_rows_is_an_error(
    folder: SessionFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tempfile.TemporaryFile", lambda dir: io.FileIO("/dev/full", "r+"))
    assert export(folder, tmp_path / "t") == 2
    *_, error = capsys.readouterr().err.splitlines()
    assert error == f"fti: {tmp_path}: cannot be written: No space left on device"
    assert list((tmp_path / "t").iterdir()) == []


def test_each_file_is_read_once(folder: SessionFolder, tmp_path: Path) -> None:
    from fti.logger.export.csv_table import CSV
    from fti.logger.export.selection import ExportSelection
    from fti.logger.export.tables import export
    from fti.logger.reading.recording import Recording

    recording = Recording.open(folder.path)
    sizes = {path: path.stat().st_size for path in recording.files}
    positions = dict[Path, list[int]]()
    recording.on_read = lambda path, position: positions.setdefault(path, []).append(position)
    assert export(recording, tmp_path / "t", CSV, ExportSelection())
    assert {path: found[-1] for path, found in positions.items()} == sizes
    assert all(found == sorted(found) for found in positions.values())


def test_an_interrupt_leaves_no_half_table(tmp_path: Path) -> None:
    folder = make_folder(tmp_path)
    record_raw(folder, range(60_000), split_s=600).close()
    out = tmp_path / "t"
    command = [sys.executable, "-m", "fti.cli.main", "export", str(folder.path), "--out", str(out), "--raw"]
    with subprocess.Popen(command, stderr=subprocess.PIPE) as process:
        until(lambda: (out / "raw_ins.csv.part").exists() or process.poll() is not None, what="the drafts")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)
    whole = sorted(p.name for p in out.iterdir())
    assert (process.returncode, whole) in [(130, []), (0, ["raw_ins.csv", "raw_radar.csv", "session.json"])]


def test_a_damaged_recording_gives_what_is_there(
    folder: SessionFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = folder.files("raw")[0]
    path.write_bytes(path.read_bytes()[:-3000])
    assert export(folder, tmp_path / "t", "--raw") == 3
    assert f"{path}: ends after byte" in capsys.readouterr().err
    assert 0 < len(read_table(tmp_path / "t" / "raw_ins.csv")) <= 150


def test_missing_sessions_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in (["info"], ["verify"], ["recover", "--in-place"], ["export", "--out", str(tmp_path / "t")]):
        assert main([*command, str(tmp_path / "nothing")]) == 2
        assert "nothing: there is no such session folder or file" in capsys.readouterr().err
    assert main(["info", str(tmp_path)]) == 2
    assert "holds no MCAP files" in capsys.readouterr().err


# -------------------------------------------------------------------------------------------------------- columns


def test_flatten() -> None:
    value = {"a": {"b": 1, "c": [1.5, None]}, "t": ["x", "y"], "o": [{"p": 1}], "e": [], "n": None}
    assert flatten(value) == {
        "a.b": 1, "a.c.0": 1.5, "a.c.1": None, "t": ["x", "y"], "o": '[{"p": 1}]', "e": [], "n": None,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([1, None], Type.INT),
        ([1, 2.5], Type.FLOAT),
        ([2**64], Type.FLOAT),
        ([True], Type.BOOL),
        ([["a"], []], Type.TEXTS),
        (["a", 1], Type.TEXT),
        ([True, 1], Type.TEXT),
        ([None], Type.TEXT),
    ],
)
def test_types_are_found(values: list[Any], kind: Type) -> None:
    finder = ColumnFinder("/x/y")
    for value in values:
        finder.add({"what": value})
    assert finder.columns() == [Column("what", kind)]


def test_a_number_that_was_never_known_is_a_number() -> None:
    finder = ColumnFinder("/x/attitude")
    finder.add({"roll": None})
    assert finder.columns() == [Column("roll", Type.FLOAT, "rad")]


def test_heights_of_an_earlier_version_keep_their_own_columns(tmp_path: Path) -> None:
    """fti 0.1 had compensated beside height_agl, which meant another height; nothing is renamed or filled in."""
    folder = make_folder(tmp_path)
    old = {"t_ns": STARTED, "sensor": "radar", "raw": 98.0, "height_agl": 100.0, "sd": 0.4}
    old |= {"compensated": 96.5, "compensated_sd": 2.1}
    schema = Schema("fti.HeightAboveGround", "jsonschema", json.dumps({"type": "object"}).encode())
    log = SplitLog(folder, LogLayout("derived", LogSettings(split_s=300, split_mb=100, attachments=(), metadata={})))
    topic = log.add_channel("/nav/height_above_ground/radar", "json", schema)
    log.write(topic, STARTED, json.dumps(old).encode())
    log.segment.close()
    assert export(folder, tmp_path / "tables") == 0
    (row,) = read_table(tmp_path / "tables" / "nav_height_above_ground_radar.csv")
    assert (row["height_agl [m]"], row["compensated [m]"], row["compensated_sd [m]"]) == ("100.0", "96.5", "2.1")
    assert not any(name.startswith("nearest") for name in row)
