"""Health and ledger as they are recorded: what has changed, everything every ten seconds, and the whole again."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog
from fti.logger.reading.note_states import NoteStates
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder

HEALTH, LEDGER = "/fti/health", "/fti/ledger"
SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
Table = dict[str, Any]


def open_log(tmp_path: Path, split_s: float = 1e6) -> RawLog:
    return RawLog(SessionFolder.create(tmp_path, "s", 0), [], LogSettings(split_s=split_s, split_mb=1000))


def link(frames: int = 0, age_ms: float | None = None, **more: Any) -> Table:
    return {"state": "silent", "frames": frames, "age_ms": age_ms, "load": {"receive": 0.0}, **more}


def health(links: Table, **more: Any) -> Table:
    return {"session": {"name": "s"}, "processes": {"recorder": {"pid": 1}}, "links": links, "devices": {}, **more}


def write(log: RawLog, topic: str, notes: list[Table], step_ns: int = SECOND) -> Path:
    """One note a second."""
    for n, note in enumerate(notes):
        log.write_json(topic, START + n * step_ns, copy.deepcopy(note))
        log.flush()
    log.close()
    return log.folder.path


def records(folder: Path, topic: str) -> list[tuple[int, Table]]:
    """As they stand in the files."""
    return [(t_ns, json.loads(data)) for _, t_ns, *_, data in Recording.open(folder).messages(topic, kind="raw")]


def together(folder: Path, topic: str) -> list[Table]:
    states = NoteStates()
    notes = [states.feed(topic, t_ns, record) for t_ns, record in records(folder, topic)]
    assert all(note.whole for note in notes)
    return [note.table for note in notes]


def test_a_silent_link_is_not_repeated_and_everything_comes_every_ten_seconds(tmp_path: Path) -> None:
    notes = [health({"quiet": link(), "busy": link(frames=n)}) for n in range(25)]
    results = [record for _, record in records(write(open_log(tmp_path), HEALTH, notes), HEALTH)]
    assert [n for n, record in enumerate(results) if record["complete"]] == [0, 10, 20]
    for n, record in enumerate(results):
        assert set(record["links"]) == ({"quiet", "busy"} if n % 10 == 0 else {"busy"})
        assert record["session"] == {"name": "s"}
        assert record.get("since_ns") == (None if n % 10 == 0 else START + (n - 1) * SECOND)


def test_what_changes_is_recorded_with_the_next_record(tmp_path: Path) -> None:
    notes = [health({"a": link(), "b": link()}) for _ in range(5)]
    for n in (2, 3):
        notes[n]["links"]["a"]["state"] = "absent"
    notes[3]["processes"]["recorder"]["pid"] = notes[4]["processes"]["recorder"]["pid"] = 2
    results = [record for _, record in records(write(open_log(tmp_path), HEALTH, notes), HEALTH)]
    assert [sorted(record["links"]) for record in results] == [["a", "b"], [], ["a"], [], ["a"]]
    assert [sorted(record["processes"]) for record in results] == [["recorder"], [], [], ["recorder"], []]


def test_age_and_estimates_of_a_silent_device_are_no_change(tmp_path: Path) -> None:
    def clock(n: int, messages: int = 3) -> Table:
        return {
            "state": "known",
            "offset_ms": 0.1 * n,
            "offset_sd_ms": 0.01 * n,
            "drift_ppm": 1.0,
            "messages": messages,
        }

    notes = [health({"a": link(age_ms=50.0 + 1000 * n, clocks=(clock(n),))}) for n in range(4)]
    notes[3]["links"]["a"]["clocks"] = (clock(3, messages=4),)
    folder = write(open_log(tmp_path), HEALTH, notes)
    assert [sorted(record["links"]) for _, record in records(folder, HEALTH)] == [["a"], [], [], ["a"]]
    ages = [note["links"]["a"]["age_ms"] for note in together(folder, HEALTH)]
    assert ages == pytest.approx([50.0, 1050.0, 2050.0, 3050.0])


def test_the_first_record_of_each_file_and_the_last_ledger_hold_everything(tmp_path: Path) -> None:
    notes: list[Table] = [{"links": {"a": {"in_frames": 1}}, "final": n == 8} for n in range(9)]
    folder = write(open_log(tmp_path, split_s=3), LEDGER, notes)
    files = Recording.open(folder).raw_files
    assert len(files) > 2
    for path in files:
        first, *others = [record for _, record in records(path, LEDGER)]
        assert first["complete"]
        assert not any(other["complete"] for other in others if not other["final"])
    assert records(folder, LEDGER)[-1][1]["complete"]
    assert together(folder, LEDGER) == notes


def test_behind_a_record_that_is_lost_only_what_is_there_is_known(tmp_path: Path) -> None:
    notes = [health({"a": link(), "b": link(frames=n)}) for n in range(13)]
    rows = records(write(open_log(tmp_path), HEALTH, notes), HEALTH)
    states = NoteStates()
    known = [states.feed(HEALTH, t_ns, record) for n, (t_ns, record) in enumerate(rows) if n != 4]
    assert [note.whole for note in known] == [True] * 4 + [False] * 5 + [True] * 3
    assert set(known[6].table["links"]) == {"b"} and known[6].table["processes"] == {}
    assert known[-1].table == notes[-1]


def test_records_of_before_are_complete() -> None:
    states = NoteStates()
    for n in range(3):
        note = health({"a": link(frames=n)})
        assert states.feed(HEALTH, n, note) == (n, note, True)
    assert tuple(states.feed(HEALTH, 3, "no table")) == (3, "no table", True)
    assert states.complete("/fti/event", 4, b"no JSON") == b"no JSON"


ENTRY = st.fixed_dictionaries({"state": st.sampled_from(["good", "silent"]), "frames": st.integers(0, 2)})
LINKS = st.dictionaries(st.sampled_from("abc"), ENTRY, min_size=3)


@given(notes=st.lists(LINKS, max_size=30), split_s=st.sampled_from([2.5, 7.0, 1e6]))
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_together_they_are_what_was_noted(
    tmp_path_factory: pytest.TempPathFactory, notes: list[Table], split_s: float
) -> None:
    wanted = [health(links) for links in notes]
    if wanted:
        folder = write(open_log(tmp_path_factory.mktemp("notes"), split_s), HEALTH, wanted)
        assert together(folder, HEALTH) == wanted


def test_two_hundred_silent_links_cost_a_tenth(tmp_path: Path) -> None:
    links = {f"link{n}": link(hint="no bytes for two seconds", load={"receive": 0.0, "write": 0.0}) for n in range(200)}
    notes = [health(links) for _ in range(60)]
    size = sum(len(json.dumps(record)) for _, record in records(write(open_log(tmp_path), HEALTH, notes), HEALTH))
    assert size < sum(len(json.dumps(note)) for note in notes) / 8
