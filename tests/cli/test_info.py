"""``fti info``: what it tells of whole, packed, killed and damaged sessions, and its picture."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from fti.alarms.alarm_list import AlarmList
from fti.alarms.condition import Condition, ConditionReport, Severity
from fti.cli._info_view import activity_bar, size_text
from fti.cli.main import main
from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog
from fti.logger.session import SessionFolder
from fti.messages.outputs import Event
from fti.messages.tables import to_table
from tests.cli.sessions import (
    ABOUT,
    LINKS,
    SECOND,
    STARTED,
    make_folder,
    mark,
    record_derived,
    record_raw,
    record_snapshots,
)

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def folder(tmp_path: Path) -> SessionFolder:
    return make_folder(tmp_path)


def record_with_gap(folder: SessionFolder) -> None:
    """Ten seconds of radar at 25 Hz, silent from 4 s to 6 s and from 9 s on; nothing from ins; two marks."""
    log = record_raw(folder, range(500), skip=lambda seq: seq % 2 == 1 or 200 <= seq < 300 or seq >= 450)
    log.write_tick(500, STARTED + 10 * SECOND)
    mark(log, 2.5, "begin of <approach> 3")
    mark(log, 3.0, "flare")
    log.write_json(
        "/fti/event", STARTED + SECOND, {"t_ns": STARTED, "level": "warning", "source": "ins", "text": "silent"}
    )
    clock = {"monotonic_ns": 0, "monotonic_raw_ns": 0}
    for t_s, offset in ((1, 250_000_000), (5, 9_000_000), (9, 251_000_000)):
        t_ns = STARTED + t_s * SECOND
        log.write_json("/fti/clock", t_ns, {"t_ns": t_ns, **clock, "realtime_ns": t_ns + offset})
    log.close()


def info(folder: SessionFolder, *arguments: str) -> int:
    return main(["info", str(folder.path), *arguments])


def info_json(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    assert info(folder, "--json") == 0
    content: dict[str, Any] = json.loads(capsys.readouterr().out)
    return content


def test_json_reports_everything(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    record_with_gap(folder)
    content = info_json(folder, capsys)
    assert content["metadata"]["fti"] == ABOUT and content["links"] == {"ins": "udp", "radar": "serial"}
    assert (content["origin"], content["mode"], content["software"]) == ("hil", "continuous", "0.1.0")
    assert (content["first_ns"], content["duration_s"]) == (STARTED, 10.0)
    assert content["clock_offset_s"] == {"begin": 0.25, "end": 0.251}
    topics = {topic["topic"]: topic for topic in content["topics"]}
    radar = topics["/raw/radar"]
    assert (radar["messages"], radar["bytes"], radar["gap_count"]) == (175, 1750, 1)
    assert radar["usual_interval_s"] == pytest.approx(0.04) and radar["jitter_sd_s"] == pytest.approx(0.0, abs=1e-6)
    assert radar["interval_p99_s"] == pytest.approx(0.04)
    assert radar["longest_gap_s"] == pytest.approx(2.04, abs=1e-9)
    assert [(gap["begin_s"], gap["length_s"]) for gap in radar["gaps"]] == [(3.96, 2.04)]
    assert [(gap["begin_s"], gap["length_s"]) for gap in radar["silences"]] == [(3.96, 2.04), (8.96, 1.04)]
    assert sum(radar["activity"]) == 175 and 0 in radar["activity"]
    silent = topics["/raw/ins"]
    assert (silent["messages"], silent["rate_hz"], silent["first_ns"], silent["configured_hz"]) == (0, None, None, 25.0)
    assert [(event["source"], event["t_s"], event["text"]) for event in content["events"]] == [
        ("ins", 1.0, "silent"), ("mark", 2.5, "begin of <approach> 3"), ("mark", 3.0, "flare"),
    ]  # fmt: skip
    assert [file["finished"] for file in content["files"]] == [True] * len(folder.files("raw"))


def test_text_reports_it_to_a_person(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    record_with_gap(folder)
    record_derived(folder)
    assert info(folder, "-v") == 0
    text = capsys.readouterr().out
    lines = text.splitlines()
    for words in (
        "2026-01-02 03:04:05 UTC, 10.0 s",
        "HIL: emulated sensors",
        "fti 0.1.0, configuration unknown 5e4f0a1b77c2",
        "real time - FTI time +0.250000 s at the start, +0.251000 s at the end",
        "attached  config.toml",
        "03:04:08.960      +3.960 s  /raw/radar: 2.040 s",
        "03:04:13.960      +8.960 s  /raw/radar: 1.040 s until the end",
        "/raw/ins: no message",
        "03:04:06.000      +1.000 s  warning: ins: silent",
        "03:04:08.000      +3.000 s  mark: flare",
    ):
        assert words in text
    row, bar = (line.split(maxsplit=1) for line in lines if line.startswith("/raw/radar"))
    assert row[1].split() == ["175", "1.8", "kB", "19.42", "0.00", "40.0", "2.040", "1"]
    assert bar[1].startswith("▆▆▆") and "▆···" in bar[1] and bar[1].endswith("···")
    assert next(line.split()[1:] for line in lines if line.startswith("/raw/ins ")) == ["0", "silent"]


@pytest.mark.parametrize(
    ("scale", "epoch_s"),
    [("utc", 0), ("gps", 315_964_800 - 18)],  # GPS runs 18 s before UTC, from 1980-01-06 on
)
def test_gnss_time_is_reported(
    folder: SessionFolder, scale: str, epoch_s: int, capsys: pytest.CaptureFixture[str]
) -> None:
    log = DerivedLog(folder, LogSettings(split_s=300, split_mb=100))
    utc_ns = STARTED + 3_600_250_000_000
    gnss = {"device": "gnss", "scale": scale, "time_ns": utc_ns - epoch_s * SECOND}
    for known in ({}, gnss, {}):
        log.write_table("/fti/device_clock", STARTED, {"t_ns": STARTED, "clocks": {}, "gnss": known})
    log.close()
    assert info(folder, "-v") == 0
    assert (
        f"UTC - FTI time +3600.250000 s by gnss ({scale}): started 2026-01-02 04:04:05 UTC" in capsys.readouterr().out
    )
    assert info_json(folder, capsys)["gnss"] == {
        "device": "gnss",
        "scale": scale,
        "utc_minus_fti_ns": 3_600_250_000_000,
    }


def test_the_pictures_of_all_topics_are_as_wide(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    record_with_gap(folder)
    record_derived(folder)
    info(folder, "-v")
    lines = capsys.readouterr().out.splitlines()
    head = next(n for n, line in enumerate(lines) if line.startswith("activity"))
    pictures = lines[head + 1 : lines.index("", head)]
    assert len(pictures) == 7 and len({len(line) for line in pictures}) == 1
    assert len(lines[head]) == len(pictures[0])


def test_a_snapshot_session_reports_it(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    record_snapshots(folder, range(50, 150))
    assert info(folder, "-v") == 0
    assert "*** SNAPSHOT: not a continuous recording" in capsys.readouterr().out
    content = info_json(folder, capsys)
    assert content["mode"] == "snapshot" and content["remarks"][0].startswith("SNAPSHOT")


def test_a_snapshot_file_of_a_continuous_session_reports_it(
    folder: SessionFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    log = RawLog(folder, LINKS, LogSettings(split_s=4, split_mb=100, metadata={"fti": ABOUT}), kind="snapshot")
    log.write_frame("ins", 0, STARTED, b"x")
    log.close()
    assert main(["info", str(folder.files("snapshot")[0])]) == 0
    assert "*** SNAPSHOT: not a continuous recording" in capsys.readouterr().out


# ------------------------------------------------------------------------------------------------- several folders


def record_in_two_places(tmp_path: Path) -> tuple[Path, Path]:
    """Six seconds in three files; the middle one lies on another medium, as every file says."""
    main_place, spare = (tmp_path / name / "s_20260102T030405Z_0" for name in ("main", "spare"))
    main_place.mkdir(parents=True)
    spare.mkdir(parents=True)
    log = RawLog(
        SessionFolder(main_place),
        LINKS,
        LogSettings(split_s=2, split_mb=100, metadata={"fti": ABOUT}, folders=[main_place, spare]),
    )
    for seq in range(300):
        log.write_frame("ins" if seq % 2 else "radar", seq, STARTED + seq * SECOND // 50, bytes(10))
        if seq % 50 == 49:
            log.flush()
    log.close()
    middle = SessionFolder(main_place).files("raw")[1]
    middle.rename(spare / middle.name)
    return main_place, spare


def test_a_session_in_several_folders_is_reported_as_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = record_in_two_places(tmp_path)
    assert main(["info", str(first), str(second), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert {topic["topic"]: topic["messages"] for topic in content["topics"]} == {"/raw/ins": 150, "/raw/radar": 150}
    assert [topic["gap_count"] for topic in content["topics"]] == [0, 0] and content["remarks"] == []
    assert [file["folder"] for file in content["files"]] == [str(first), str(second), str(first)]
    assert main(["info", "-v", str(first), str(second)]) == 0
    assert f"{second}/s_20260102T030405Z_0_001.mcap" in capsys.readouterr().out


def test_who_gives_one_folder_of_several_gets_the_others_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = record_in_two_places(tmp_path)
    assert main(["info", str(first)]) == 0
    assert f"more of this session is in {second}; name all its folders" in capsys.readouterr().out
    shutil.rmtree(second)  # the medium is not there
    assert main(["info", str(first)]) == 0
    assert f"raw files 001 are missing; they may be in {second}" in capsys.readouterr().out
    assert main(["info", str(SessionFolder(first).files("raw")[0])]) == 0
    assert "not here" not in capsys.readouterr().out  # who gives a file, means a file


def test_folders_of_two_sessions_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folders = [SessionFolder.create(tmp_path, name, STARTED) for name in ("s", "t")]
    for session in folders:
        record_raw(session, range(10)).close()
    for command in (["info"], ["export", "--out", str(tmp_path / "tables")]):
        assert main([command[0], *(str(session.path) for session in folders), *command[1:]]) == 2
        assert "belongs to session t_20260102T030405Z_0, but" in capsys.readouterr().err
    assert not (tmp_path / "tables").exists()


def test_a_snapshot_beside_the_recording_counts_nothing_twice(
    folder: SessionFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record_with_gap(folder)
    assert info(folder, "-v") == 0
    alone = [line.split() for line in capsys.readouterr().out.splitlines()]
    shutil.copy(folder.files("raw")[0], folder.path / f"{folder.name}_snapshot_000.mcap")
    assert info(folder, "-v") == 0
    both = [line.split() for line in capsys.readouterr().out.splitlines() if "_snapshot_000.mcap" not in line]
    assert both == alone
    assert main(["export", str(folder.path), "--out", str(tmp_path / "t"), "--raw"]) == 0
    assert "raw_radar.csv  175 rows" in capsys.readouterr().out
    assert (tmp_path / "t" / "fti_event.csv").read_text().count("flare") == 1


def test_a_killed_and_a_damaged_file_are_reported(
    folder: SessionFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = record_raw(folder, range(230))
    killed = SessionFolder(Path(shutil.copytree(folder.path, tmp_path / "killed")))
    log.close()
    assert info(killed, "-v") == 3
    found = capsys.readouterr()
    assert "ends after byte" in found.out and "ends after byte" in found.err
    path = folder.files("raw")[0]
    whole = path.read_bytes()
    at = whole.index(b"/raw/radar") + 400
    path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])
    assert info(folder, "--json") == 3
    found = capsys.readouterr()
    assert "is damaged after byte" in json.loads(found.out)["files"][0]["fault"]
    assert found.err.startswith(f"fti: {path}: is damaged after byte") and found.err.count("\n") == 1


def test_a_packed_file_is_read_and_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from mcap.writer import CompressionType, Writer

    path = tmp_path / "s_000.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start()
        channel = writer.register_channel("/raw/ins", "x-fti-raw", 0)
        for n in range(100):
            writer.add_message(channel, STARTED + n * SECOND, b"x" * 50, STARTED + n * SECOND, n)
        writer.finish()  # type: ignore[no-untyped-call]
    assert main(["info", "-v", str(path)]) == 0
    text = capsys.readouterr().out
    assert "finished, packed (zstd)" in text and "/raw/ins" in text


def test_an_empty_session_is_reported(
    folder: SessionFolder, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    record_raw(folder, range(0)).close()
    assert info(folder, "--plot", str(tmp_path / "p.svg")) == 0
    assert "no messages" in capsys.readouterr().out


def test_bars_and_sizes() -> None:
    assert activity_bar([0, 0.001, 0.5, 0.8, 1.0, 1.2, 2.0]) == "·▁▃▆▆▆█"
    assert [size_text(n) for n in (0, 999, 1500, 2_500_000, 5e12)] == ["0 B", "999 B", "1.5 kB", "2.5 MB", "5000.0 GB"]


# -------------------------------------------------------------------------------------------------------- the plot


@pytest.mark.parametrize("suffix", ["svg", "html"])
def test_the_plot_shows_links_gaps_and_marks(
    folder: SessionFolder, tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str]
) -> None:
    record_with_gap(folder)
    path = tmp_path / f"plot.{suffix}"
    assert info(folder, "--plot", str(path)) == 0
    text = path.read_text()
    root = ET.fromstring(text[text.index("<svg") : text.index("</svg>") + 6])
    texts = ["".join(element.itertext()) for element in root.iter(f"{SVG}text")]
    assert "ins" in texts and "radar" in texts and "no message" in texts
    assert any(line.startswith("begin of <approach> 3") for line in texts)
    silent = [title.text for title in root.iter(f"{SVG}title") if title.text and title.text.startswith("silent for")]
    assert silent == [
        "silent for 10.000 s from 0.000 s on",
        "silent for 2.040 s from 3.960 s on",
        "silent for 1.040 s from 8.960 s on",
    ]
    assert text.replace("http://www.w3.org/2000/svg", "").find("http") == -1
    with pytest.raises(SystemExit, match="2"):
        info(folder, "--plot", str(path))
    assert "already exists; choose another name" in capsys.readouterr().err


def test_a_plot_of_another_kind_is_refused(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        info(folder, "--plot", "plot.png")
    assert "must end with .svg or .html" in capsys.readouterr().err


def test_progress_never_mixes_with_json(folder: SessionFolder) -> None:
    record_with_gap(folder)
    command = [sys.executable, "-m", "fti.cli.main", "info", str(folder.path), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    assert json.loads(done.stdout)["origin"] == "hil" and done.stderr == ""


def test_alarms_are_listed_with_their_durations(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    log, alarms = record_raw(folder, range(500)), AlarmList()
    alert = Condition("integrity_alert", Severity.WARNING, "GROUND CLEARANCE ALERT", "obstacle")
    silent = Condition("link:ins", Severity.CAUTION, "LINK INS SILENT")
    alarms.report(ConditionReport(STARTED + 2 * SECOND, "integrity", alert))
    alarms.report(ConditionReport(STARTED + 3 * SECOND, "link ins", silent))
    alarms.report(ConditionReport(STARTED + 5 * SECOND, "integrity", None))
    alarms.acknowledge("anna", STARTED + 6 * SECOND, "integrity_alert")
    for change in alarms.take_changes():
        log.write_json("/fti/alarm", change.t_ns, to_table(change))
    log.close()
    assert info(folder, "-v") == 0
    text = capsys.readouterr().out
    assert "warning: GROUND CLEARANCE ALERT: obstacle (for 3.0 s, acknowledged by anna)" in text
    assert "caution: LINK INS SILENT (to the end)" in text
    found = info_json(folder, capsys)["alarms"]
    assert [(alarm["id"], alarm["end_ns"]) for alarm in found] == [
        ("integrity_alert", STARTED + 5 * SECOND),
        ("link:ins", None),
    ]


def test_an_event_in_raw_and_derived_files_counts_once(
    folder: SessionFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    """Navigation sends it to the recorder, and writes it too; a repeated event stays one of its own."""
    raw, derived = record_raw(folder, range(500)), DerivedLog(folder, LogSettings(split_s=300, split_mb=100))
    for t_s, in_raw, in_derived in ((1, 1, 1), (2, 2, 2), (3, 0, 1), (4, 1, 0)):
        t_ns = STARTED + t_s * SECOND
        event = Event(t_ns=t_ns, level="info", source="nav", text=f"event {t_s}")
        for _ in range(in_raw):
            raw.write_json("/fti/event", t_ns, event)
        for _ in range(in_derived):
            derived.write_output(event)
    raw.close()
    derived.close()
    content = info_json(folder, capsys)
    assert [event["text"] for event in content["events"]] == ["event 1", "event 2", "event 2", "event 3", "event 4"]
    counts = [topic["messages"] for topic in content["topics"] if topic["topic"] == "/fti/event"]
    assert counts == [4, 1]
