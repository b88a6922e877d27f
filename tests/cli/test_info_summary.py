"""The ten lines of ``fti info``: what a flight-test engineer asks first, from sessions whose content is known."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from fti.alarms.alarm_list import AlarmList
from fti.alarms.condition import Condition, ConditionReport, Severity
from fti.cli.main import main
from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.logger.session import SessionFolder
from fti.messages.outputs import ClearanceIntegrity, IntegrityState, NavSolution, Output
from fti.messages.reasons import Reason
from fti.messages.tables import to_table
from tests.cli.sessions import ABOUT, SECOND, STARTED, make_folder, mark, record_raw
from tests.cli.test_hostile_texts import write_foreign


def summary(path: Path, capsys: pytest.CaptureFixture[str], code: int = 0) -> dict[str, str]:
    """The lines by their names."""
    capsys.readouterr()
    assert main(["info", str(path)]) == code
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == str(path) and lines[-1] == f"details: fti info -v {path}"
    return {line[2:14].strip(): line[14:] for line in lines[1:-1]}


def account(recorded: int, dropped: dict[str, int]) -> dict[str, Any]:
    total = recorded + sum(dropped.values())
    lost = {name: {"frames": n, "bytes": 10 * n} for name, n in dropped.items()}
    return {
        "in_frames": total, "in_bytes": 10 * total, "recorded_frames": recorded, "recorded_bytes": 10 * recorded,
        "held_frames": 0, "held_bytes": 0, "dropped": lost,
    }  # fmt: skip


def ledger(started_ns: int, links: dict[str, dict[str, Any]]) -> dict[str, Any]:
    received = {
        name: {**table, "sent": account(0, {}), "errors": {}, "stamp_refused": 0} for name, table in links.items()
    }
    recorder = {"pid": 7, "started_ns": started_ns, "first_seq": 0}
    head = {"t_ns": started_ns, "recorder": recorder, "next_seq": 0, "final": False}
    return {**head, "ticks": account(0, {}), "links": received}


def record_derived(folder: SessionFolder, outputs: list[Output]) -> None:
    log = DerivedLog(folder, LogSettings(split_s=300, split_mb=100, metadata={"fti": ABOUT}))
    for output in outputs:
        log.write_output(output)
    log.close()


def integrity(state: str, s: float | None, *reasons: Reason) -> ClearanceIntegrity:
    return ClearanceIntegrity(
        t_ns=STARTED, t_valid_ns=STARTED, state=IntegrityState(state), reasons=reasons, valid=False, s_end=s
    )


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SessionFolder:
    monkeypatch.setenv("COLUMNS", "250")
    return make_folder(tmp_path)


def test_a_whole_session_is_ten_lines(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    log = record_raw(folder, range(500), skip=lambda seq: 200 <= seq < 300, split_s=300)
    for n, text in enumerate(("takeoff", "approach 1", "approach 2", "landed")):
        mark(log, n, text)
    log.close()
    main(["info", str(folder.path)])
    assert len(capsys.readouterr().out.splitlines()) == 10
    lines = summary(folder.path, capsys)
    assert lines["session"] == "s, HIL: emulated sensors, no flight, continuous"
    assert lines["started"] == "2026-01-02 03:04:05 UTC, 10.0 s"
    assert lines["files"].startswith("1, ") and lines["files"].endswith(" kB, all finished")
    assert lines["losses"] == "dropped frames are unknown (no ledger); longest silence 2.0 s on /raw/radar"
    assert lines["marks"] == "4: takeoff; approach 1; approach 2; and 1 more"
    assert (lines["alarms"], lines["approaches"], lines["position"]) == ("none", "none", "no outputs of navigation")


def test_dropped_frames_of_all_recorders_are_added(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    """The second recorder began after a crash; frames that no trigger requested are no loss."""
    log = record_raw(folder, range(0, 500, 2))
    for n, links in enumerate(
        (
            {"radar": account(10, {"buffer_overflow": 5}), "ins": account(10, {"not_triggered": 30})},
            {
                "radar": account(20, {"buffer_overflow": 7, "socket_queue": 2}),
                "ins": account(10, {"not_triggered": 90}),
            },
        )
    ):
        log.write_json("/fti/ledger", STARTED + n, ledger(STARTED, links))
    log.write_json(
        "/fti/ledger", STARTED + 9, ledger(STARTED + 9, {"radar": account(0, {}), "ins": account(3, {"storage": 40})})
    )
    log.write_json("/fti/ledger", STARTED + 10, {"recorder": "foreign"})
    log.close()
    assert summary(folder.path, capsys)["losses"] == (
        "49 frames dropped (40 of ins, 9 of radar); no message on /raw/ins"
    )


def test_without_a_drop_it_reports_that(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    log = record_raw(folder, range(500))
    log.write_json("/fti/ledger", STARTED, ledger(STARTED, {"radar": account(10, {})}))
    log.close()
    assert summary(folder.path, capsys)["losses"] == "no frame dropped"


def test_a_file_that_a_kill_left_open_is_named(
    folder: SessionFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = record_raw(folder, range(230), split_s=300)
    killed = Path(shutil.copytree(folder.path, tmp_path / "killed"))
    log.close()
    (file,) = killed.iterdir()
    assert f"not whole: {file.name}: ends after byte" in summary(killed, capsys, code=3)["files"]


def test_the_worst_alarm_is_the_longest_of_the_worst_severity(
    folder: SessionFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    log, alarms = record_raw(folder, range(500)), AlarmList()
    for name, severity, begin_s, end_s in (
        ("silent", Severity.CAUTION, 1, 9),
        ("short", Severity.WARNING, 2, 3),
        ("alert", Severity.WARNING, 4, 7),
    ):
        alarms.report(
            ConditionReport(STARTED + begin_s * SECOND, name, Condition(name, severity, name.upper(), "cause"))
        )
        alarms.report(ConditionReport(STARTED + end_s * SECOND, name, None))
    for change in alarms.take_changes():
        log.write_json("/fti/alarm", change.t_ns, to_table(change))
    log.close()
    assert (
        summary(folder.path, capsys)["alarms"]
        == "3 (2 warning, 1 caution), the worst: warning: ALERT: cause (for 3.0 s)"
    )


def test_approaches_are_listed_with_the_shares_of_their_states(
    folder: SessionFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    """An approach ends at its end, or by an approach further back; what no full window has compared does not count."""
    record_raw(folder, range(500)).close()
    record_derived(
        folder,
        [
            integrity("unavailable", None, Reason.OUTSIDE_PROFILE),
            integrity("acquire", 4000.0),
            integrity("unavailable", None, Reason.STALE),
            *(integrity("ok", s) for s in (3600.0, 3500.0, 3400.0)),
            integrity("monitor", 3420.0),
            integrity("unavailable", None, Reason.STALE),
            integrity("alert", 1000.0),
            integrity("unavailable", None, Reason.GO_AROUND),
            integrity("unavailable", None, Reason.NO_POSITION),
            integrity("caution", 900.0),  # another one, although farther on the path
            integrity("ok", 2000.0),
            integrity("acquire", 3000.0),
        ],
    )
    assert summary(folder.path, capsys)["approaches"] == (
        "3: 4.0 to 1.0 km before the intercept point, ok 50 %, unavailable 17 %, monitor 17 %, alert 17 %; "
        "0.9 to 0.9 km before the intercept point, caution 100 %; 2.0 to 2.0 km before the intercept point, ok 100 %"
    )


def test_position_sources_are_shares_of_the_time(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    record_raw(folder, range(500)).close()
    sources = [("gnss", True)] * 140 + [("ins", True), ("ins", False)] * 20 + [(None, False)] * 20
    times = range(STARTED, STARTED + 200 * SECOND // 2, SECOND // 2)
    record_derived(
        folder,
        [
            NavSolution(t_ns=t_ns, t_valid_ns=t_ns, valid=valid, reasons=(), position_source=source)
            for t_ns, (source, valid) in zip(times, sources, strict=True)
        ],
    )
    assert summary(folder.path, capsys)["position"] == "from gnss 70 %, ins 20 %, no source 10 %; valid 80 %"


def test_foreign_outputs_are_ignored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = {"state": ["ok"], "s_end": "far", "reasons": 1, "position_source": ["ins"], "valid": "yes"}
    topics = ("/nav/clearance_integrity", "/nav/nav_solution", "/fti/ledger")
    write_foreign(tmp_path / "s_derived_000.mcap", {topic: [table, [], 1] for topic in topics})
    lines = summary(tmp_path / "s_derived_000.mcap", capsys)
    assert (lines["approaches"], lines["losses"]) == ("none", "dropped frames are unknown (no ledger)")


@pytest.mark.parametrize("columns", [80, 200])
def test_it_fits_the_terminal(
    folder: SessionFolder, columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = record_raw(folder, range(500))
    mark(log, 1.0, "a long mark of many words " * 20)
    log.close()
    monkeypatch.setenv("COLUMNS", str(columns))
    capsys.readouterr()
    assert main(["info", str(folder.path)]) == 0
    lines = capsys.readouterr().out.splitlines()[1:-1]
    assert 0.8 * columns < max(map(len, lines)) <= columns
