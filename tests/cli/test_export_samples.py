"""``fti export`` of recorded sessions: every sample, and what the derived file holds is the same.

The oracle reads the files with the reader of the MCAP project and feeds the bytes of each link to the drivers.
"""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader

from fti import config as configuration
from fti.cli.main import main
from fti.devices import bind_devices
from fti.logger.export.csv_table import format_utc
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from tests.helpers import until
from tests.sessions.record import FOLDER

SESSIONS = sorted(path for path in FOLDER.glob("*/*/*_0") if path.is_dir())
DEMONSTRATION = next(path for path in SESSIONS if path.parent.name == "demonstration")
Row = dict[str, Any]


def export(session: Path, out: Path, *arguments: str) -> int:
    return main(["export", str(session), "--out", str(out), "--format", "parquet", *arguments])


def table(out: Path, name: str) -> list[Row]:
    """The rows without UTC, which Python's own type cannot hold."""
    rows: list[Row] = pq.read_table(out / f"{name}.parquet").drop_columns(["utc"]).to_pylist()
    return rows


def recorded(session: Path, pattern: str) -> Iterator[tuple[str, int, int, bytes]]:
    """Topic, log time, publish time and data of the messages of some files."""
    for path in sorted(session.glob(pattern)):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                yield channel.topic, message.log_time, message.publish_time, message.data


def measurements(session: Path) -> Iterator[tuple[str, int, int, Row]]:
    """Those of the derived files."""
    for topic, log_ns, publish_ns, data in recorded(session, "*_derived_*.mcap"):
        if not topic.startswith(("/nav/", "/fti/")):
            yield topic, log_ns, publish_ns, json.loads(data)


def count_messages(session: Path) -> Counter[tuple[str, str]]:
    """Messages of each device and class that the drivers decode from the bytes of each link."""
    texts = {name: data.decode() for name, data in Recording.open(session).attachments().items()}
    text = texts.pop("config.toml")
    config = configuration.parse(configuration.parse_toml(text, "config"), text, Path("config.toml"))
    frames = defaultdict(list)
    for topic, log_ns, _, data in recorded(session, "*_0_[0-9]*.mcap"):
        frames[topic].append((log_ns, data))
    counts: Counter[tuple[str, str]] = Counter()
    for bound in bind_devices(config, texts):
        decoder = bound.make_decoder()
        for log_ns, data in frames[f"/raw/{bound.device.link}"]:
            counts.update((bound.device.name, type(m).__name__) for m in decoder.feed(data, log_ns))
    return counts


def unequal(expected: Any, row: Row, path: str) -> Iterator[str]:
    """Fields of a recorded message whose cells differ."""
    if isinstance(expected, dict):
        for key, item in expected.items():
            yield from unequal(item, row, f"{path}.{key}" if path else key)
    elif isinstance(expected, list) and expected and isinstance(expected[0], int | float):
        for n, item in enumerate(expected):
            yield from unequal(item, row, f"{path}.{n}")
    else:
        found = row.get(path, row.get(f"{path}.0"))
        if isinstance(expected, list) and isinstance(found, str):  # a list of messages is JSON
            found = json.loads(found)
        if isinstance(expected, float) and isinstance(found, float) and math.isclose(expected, found, rel_tol=1e-12):
            return
        if found != expected:
            yield f"{path}: {expected!r}, exported {found!r}"


@pytest.mark.parametrize("session", SESSIONS, ids=lambda path: path.parent.name)
def test_every_sample_is_a_row_and_those_of_the_derived_file_are_equal(session: Path, tmp_path: Path) -> None:
    assert export(session, tmp_path) == 0
    counts = count_messages(session)
    rows = {kind: table(tmp_path, f"{kind[0]}_{snake(kind[1])}") for kind in counts}
    assert {kind: len(found) for kind, found in rows.items()} == counts
    by_time: dict[tuple[str, int], list[Row]] = defaultdict(list)
    for (device, kind), found in rows.items():
        for row in found:
            by_time[f"/{device}/{snake(kind)}", row["log_time_ns"]].append(row)
    kept = 0
    for topic, log_ns, publish_ns, message in measurements(session):
        candidates = [row for row in by_time[topic, log_ns] if row["publish_time_ns"] == publish_ns]
        differences = [list(unequal(message, row, "")) for row in candidates]
        assert [] in differences, (topic, log_ns, differences[:1])
        kept += 1
    assert 300 < kept < counts.total()


def snake(name: str) -> str:
    return "".join(f"_{c.lower()}" if c.isupper() else c for c in name).removeprefix("_")


def test_thin_gives_the_measurements_of_the_derived_file(tmp_path: Path) -> None:
    """The derived files of a flight hold 25 Hz."""
    assert export(DEMONSTRATION, tmp_path, "--thin", "25") == 0
    expected = Counter(topic for topic, *_ in measurements(DEMONSTRATION))
    found = {topic: len(table(tmp_path, topic.strip("/").replace("/", "_"))) for topic in expected}
    assert found == expected


def test_utc_is_the_time_of_validity(tmp_path: Path) -> None:
    assert export(DEMONSTRATION, tmp_path, "--topic", "/ins/attitude") == 0
    found = pq.read_table(tmp_path / "ins_attitude.parquet")
    assert str(found.schema.field("utc").type) == "timestamp[ns, tz=UTC]"
    assert found.column("utc").cast(pa.int64()).to_pylist() == found.column("publish_time_ns").to_pylist()
    assert main(["export", str(DEMONSTRATION), "--out", str(tmp_path / "csv"), "--topic", "/ins/attitude"]) == 0
    line = (tmp_path / "csv" / "ins_attitude.csv").read_text().splitlines()[1].split(",")
    first_ns = found.column("publish_time_ns").to_pylist()[0]
    assert line[3].startswith("2026-11-27T13:51:") and line[3].endswith(f".{first_ns % 10**9:09d}Z")
    assert format_utc(86_400_000_000_005) == "1970-01-02T00:00:00.000000005Z"


def test_unknown_integers_stay_integers(tmp_path: Path) -> None:
    assert export(DEMONSTRATION, tmp_path, "--topic", "/nav/nav_solution") == 0
    schema = pq.read_table(tmp_path / "nav_nav_solution.parquet").schema
    stated = {c["name"]: c["numpy_type"] for c in json.loads(schema.metadata[b"pandas"])["columns"]}
    assert str(schema.field("t_valid_ns").type) == "int64" and stated == {"t_ns": "Int64", "t_valid_ns": "Int64"}
    assert main(["export", str(DEMONSTRATION), "--out", str(tmp_path / "csv"), "--topic", "/gnss/satellites"]) == 0
    lines = [line.split(",") for line in (tmp_path / "csv" / "gnss_satellites.csv").read_text().splitlines()]
    assert {line[lines[0].index("used")] for line in lines[1:]} <= {"", *map(str, range(40))}


def test_angles_are_in_degrees(tmp_path: Path) -> None:
    assert export(DEMONSTRATION, tmp_path / "rad", "--topic", "/ins/*") == 0
    assert export(DEMONSTRATION, tmp_path / "deg", "--topic", "/ins/*", "--degrees") == 0
    for name, column in (("ins_attitude", "heading"), ("ins_position", "lat"), ("ins_imu_sample", "gyro_b.1")):
        radians, degrees = (table(tmp_path / unit, name) for unit in ("rad", "deg"))
        assert [row[column] for row in degrees] == pytest.approx([57.29577951308232 * row[column] for row in radians])
        assert [row["publish_time_ns"] for row in degrees] == [row["publish_time_ns"] for row in radians]
    fields = pq.read_table(tmp_path / "deg" / "ins_imu_sample.parquet").schema
    assert [fields.field(name).metadata[b"unit"] for name in ("gyro_b.1", "accel_b.1")] == [b"deg/s", b"m/s^2"]
    out = tmp_path / "csv"
    assert main(["export", str(DEMONSTRATION), "--out", str(out), "--topic", "/ins/attitude", "--degrees"]) == 0
    assert "heading [deg]" in (out / "ins_attitude.csv").read_text().splitlines()[0]


def test_a_topic_that_a_device_could_have_but_has_not_is_an_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert export(DEMONSTRATION, tmp_path, "--topic", "/ins/airspeed", "--topic", "/ins/attitude") == 2
    assert "--topic /ins/airspeed: matches nothing" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_frames_are_not_resampled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert export(DEMONSTRATION, tmp_path, "--raw", "--resample", "10") == 2
    assert "--raw: frames cannot be resampled" in capsys.readouterr().err


def test_an_event_is_a_row(tmp_path: Path) -> None:
    """Raw and derived files both hold the events of navigation."""
    assert export(DEMONSTRATION, tmp_path, "--topic", "/fti/event") == 0
    per_file = [
        Counter((log_ns, json.loads(data)["message"]) for topic, log_ns, _, data in recorded(DEMONSTRATION, pattern)
                if topic == "/fti/event")
        for pattern in ("*_0_[0-9]*.mcap", "*_derived_*.mcap")
    ]  # fmt: skip
    rows = Counter((row["log_time_ns"], row["message"]) for row in table(tmp_path, "fti_event"))
    assert rows == per_file[0] | per_file[1] and rows.total() < per_file[0].total() + per_file[1].total()


def test_an_interrupt_while_frames_are_decoded_leaves_no_half_table(tmp_path: Path) -> None:
    out = tmp_path / "t"
    command = [sys.executable, "-m", "fti.cli.main", "export", str(DEMONSTRATION), "--out", str(out)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        until(lambda: (out / "ins_attitude.csv.part").exists() or process.poll() is not None, what="the drafts")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)
    names = [path.name for path in out.iterdir()]
    assert (process.returncode, bool(names)) in [(130, False), (0, True)]  # it may have been done
    assert not any(name.endswith(".part") for name in names)


# ------------------------------------------------------------------------------------------------- what is missing


def copy_of(session: Path, folder: Path, *patterns: str) -> Path:
    """Some files of a session."""
    copy = folder / session.name
    copy.mkdir()
    for path in (path for pattern in patterns for path in session.glob(pattern)):
        (copy / path.name).write_bytes(path.read_bytes())
    return copy


def test_without_frames_the_recorded_measurements_are_exported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session = copy_of(DEMONSTRATION, tmp_path, "*_derived_*.mcap")
    assert export(session, tmp_path / "out") == 0
    assert (
        f"note: measurements are as recorded, at most 25 Hz: {session}: contains no frames" in capsys.readouterr().err
    )
    expected = Counter(topic for topic, *_ in measurements(session))
    assert expected["/ins/attitude"] == len(table(tmp_path / "out", "ins_attitude"))


def test_without_derived_files_the_measurements_are_those_of_the_frames(tmp_path: Path) -> None:
    session = copy_of(DEMONSTRATION, tmp_path, "*_0_[0-9]*.mcap")
    assert export(session, tmp_path / "out") == 0
    assert len(table(tmp_path / "out", "ins_attitude")) == count_messages(session)["ins", "Attitude"]


def test_where_frames_are_missing_the_recorded_measurements_are_rows(tmp_path: Path) -> None:
    session = copy_of(DEMONSTRATION, tmp_path, "*_derived_*.mcap")
    source = Recording.open(DEMONSTRATION)
    attachments = [(name, "text/plain", data) for name, data in source.attachments().items()]
    settings = LogSettings(split_s=600, split_mb=100, attachments=attachments, metadata=source.metadata)
    log = RawLog(SessionFolder(session), [RawTopic(name, kind, {}) for name, kind in source.links.items()], settings)
    frames = [frame for frame in source.frames() if frame.link != "fti_tick"]
    begin_ns, end_ns = (frames[0].t_rx_ns + t_s * 10**9 for t_s in (5, 10))
    for frame in frames:
        if not begin_ns < frame.t_rx_ns < end_ns:
            log.write_frame(frame.link, frame.seq, frame.t_rx_ns, frame.data)
    log.close()
    assert export(session, tmp_path / "out", "--topic", "/ins/attitude") == 0
    times = [row["log_time_ns"] for row in table(tmp_path / "out", "ins_attitude")]
    derived = [log_ns for topic, log_ns, *_ in measurements(session) if topic == "/ins/attitude"]
    decoded = [frame.t_rx_ns for frame in frames if frame.link == "ins_eth" and not begin_ns < frame.t_rx_ns < end_ns]
    missing = [t_ns for t_ns in derived if begin_ns < t_ns < end_ns]
    assert times == sorted({*missing, *decoded} & {*times}) and {*missing} <= {*times} and len(missing) > 100
    assert len(times) - len(missing) == len({*decoded} & {*times})
