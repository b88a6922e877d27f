"""Texts of a recording, in each command that reads one: none controls the terminal, and none begins a line."""

from __future__ import annotations

import csv
import json
import re
import unicodedata
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer
from rich.console import Console

from fti.alarms.alarm_list import Alarm
from fti.alarms.condition import Condition, Severity
from fti.cli._printing import print_json, print_line, print_status
from fti.cli._watch_view import render
from fti.cli.main import main
from fti.clock import FakeClock
from fti.logger.export.names import table_names
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import SessionFolder
from fti.messages.outputs import Event
from fti.service.supervisor.event_publisher import EventPublisher
from fti.terminal_text import escape_controls
from fti.web.live_state import LiveState
from tests.cli.sessions import SECOND, STARTED

EVIL = "x\x1b]0;owned\x07\x1b[2J\nINJECTED\r\x9b31m\x7f\u202egnp.exe\u2028[bold red]m[/]"
#: Written without the code under test: what no output may hold, but the newlines at the ends of its own lines.
FORBIDDEN = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff]")
COMMANDS = (
    ("info",),
    ("info", "-v"),
    ("info", "--json"),
    ("verify",),
    ("export", "--out", "tables", "--raw"),
    ("export", "--out", "tables", "--topic", "nothing"),
    ("sync",),
    ("latency",),
    ("replay",),
    ("reprocess", "--out", "again"),
    ("compare", "SESSION"),
    ("compare", "SESSION", "--only", EVIL),
    ("score", "SESSION"),
    ("recover", "--out", "rescued"),
    ("recover", "--in-place"),
    ("pack",),
)


def write_foreign(path: Path, topics: dict[str, list[Any]]) -> None:
    """A file of the official writer with JSON messages on any topics."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for topic, messages in topics.items():
            channel = writer.register_channel(topic, "json", 0)
            for n, message in enumerate(messages):
                writer.add_message(channel, STARTED + n, json.dumps(message).encode(), STARTED + n)
        writer.finish()  # type: ignore[no-untyped-call]


@pytest.fixture
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    folder = SessionFolder.create(tmp_path, "s", STARTED)
    config = json.dumps(EVIL).replace("\x7f", "\\u007f") + " = 1"
    log = RawLog(
        folder,
        [RawTopic("radar", "serial", {}), RawTopic(EVIL, EVIL, {EVIL: EVIL})],
        LogSettings(
            split_s=60,
            split_mb=10,
            metadata={
                "fti": dict.fromkeys(("name", "origin", "mode", "software", "config_file"), EVIL),
                EVIL: {"a": EVIL},
            },
            attachments=[("config.toml", "text/plain", config.encode()), (EVIL, EVIL, b"")],
        ),
    )
    for seq in range(100):
        t_ns = STARTED + seq * SECOND // 50
        log.write_frame("radar" if seq % 2 else EVIL, seq, t_ns, bytes(10))
    log.write_json("/fti/event", STARTED, Event(t_ns=STARTED, level="error", source=EVIL, text=EVIL))
    log.close()
    write_foreign(folder.file_path("derived", 0), {f"/{EVIL}": [{EVIL: EVIL}]})
    name = EVIL.replace("/", "")
    folder.file_path("raw", 0).rename(folder.path / f"{name}_000.mcap")
    folder.path.rename(folder.path.with_name(name))
    return folder.path.with_name(name)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_no_text_of_a_recording_controls_the_terminal(
    session: Path, command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    name, *more = (str(session) if word == "SESSION" else word for word in command)
    words = [name, more[0], str(session)] if name == "score" else [name, str(session), *more]
    if name == "score":
        words[1] = "nominal"
    main(words)
    printed = capsys.readouterr()
    assert "owned" in printed.out + printed.err
    for text in (printed.out, printed.err):
        assert FORBIDDEN.search(text) is None
        assert "\nINJECTED" not in text


def test_every_character_that_controls_is_written_visibly() -> None:
    for code in range(0x110000):
        if unicodedata.category(chr(code)) in ("Cc", "Cs", "Zl", "Zp") or unicodedata.bidirectional(chr(code)) in (
            *("LRE", "RLE", "PDF", "LRO", "RLO", "LRI", "RLI", "FSI", "PDI", "BN"),
        ):
            text = escape_controls(chr(code))
            assert text.isascii() or unicodedata.category(chr(code)) == "Cn", hex(code)
    assert escape_controls("Höhe ü. Grund – 5 µm ≥ 3° [bold]") == "Höhe ü. Grund – 5 µm ≥ 3° [bold]"


def test_lines_json_and_states_are_escaped(capsys: pytest.CaptureFixture[str]) -> None:
    print_line(EVIL)
    print_line(EVIL, error=True)
    print_json({EVIL: EVIL})
    out, err = capsys.readouterr()
    assert FORBIDDEN.search(out + err) is None
    assert out.count("\n") == 1 + 3
    print_status(EVIL)
    assert FORBIDDEN.search(capsys.readouterr().err.removesuffix("\x1b[K\r")) is None


def test_the_terminal_picture_takes_no_text_as_a_command_or_as_markup() -> None:
    live = LiveState(0)
    health: dict[str, Any] = {
        "t_ns": 0,
        "session": {"name": EVIL, "origin": EVIL, "state": EVIL},
        "links": {EVIL: {"state": EVIL, "hint": EVIL, "ledger": {"errors": {EVIL: 1}}}},
    }
    live.update("/health", health, 0)
    console = Console(width=400, force_terminal=False, record=True)
    with console.capture() as shown:
        alarm = Alarm(Condition(EVIL, Severity.WARNING, EVIL, EVIL), 0, 0, acknowledged_by=EVIL).as_json()
        row = {**alarm, "severity": EVIL, "is_acknowledged": False, "consequences": []}
        console.print(render(live.state(0) | {"alarms": [row]}))
    assert "[bold red]m[/]" in shown.get()
    assert FORBIDDEN.search(shown.get()) is None


def test_names_of_tables_are_safe_and_unique() -> None:
    topics = ["/ins/attitude", "/a/b", "/a_b", "/A_B", "../../etc/passwd", "-rf", ".hidden", "/", "", "//", EVIL]
    topics += ["x" * 1000, "x" * 999, "é" * 1000, "a\0b", "c:\\d", "\ud800"]
    names = table_names(topics)
    assert names["/ins/attitude"] == "ins_attitude"
    assert names["/a/b"] == "a_b"
    assert len({name.lower() for name in names.values()}) == len(topics)
    for name in names.values():
        assert re.fullmatch(r"\w[\w.\-]*", name), name
        assert len(name.encode()) <= 130


def test_cells_of_a_table_are_no_formulas(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    texts = ["=1+1", "+cmd|'/c calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "-1.5", "plain", ""]
    file = tmp_path / "s_000.mcap"
    write_foreign(file, {"/t": [{"text": text, "=head": [text, "b"], "number": -1.5} for text in texts]})
    assert main(["export", str(file), "--out", str(tmp_path / "out")]) == 0
    with (tmp_path / "out" / "t.csv").open(newline="", encoding="utf-8") as table:
        head, *rows = csv.reader(table)
    assert "'=head" in head
    for column, suffix in ((head.index("text"), ""), (head.index("'=head"), " b")):
        evaluated = texts[:4] + (["-1.5"] if suffix else [])
        assert [row[column] for row in rows] == [
            {"\t=1": "\\t=1", "\r=1": "\\r=1"}.get(text, f"'{text}" if text in evaluated else text) + suffix
            for text in texts
        ]
    assert {row[head.index("number")] for row in rows} == {"-1.5"}


def test_what_the_supervisor_announces_goes_through_the_same_way(capsys: pytest.CaptureFixture[str]) -> None:
    event_publisher = EventPublisher(
        FakeClock(), lambda *_: None, lambda line: print_line(line, flush=True), lambda *_: None
    )
    event_publisher.publish_event("error", EVIL, EVIL)
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    assert FORBIDDEN.search(out) is None
