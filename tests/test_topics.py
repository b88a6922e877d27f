"""The table of topics is that of the recordings: each recorded topic has a row with its file and its schema."""

from __future__ import annotations

import json
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from mcap.reader import make_reader

from fti.bus.shapes import ANY_OUTPUT, shape_of
from fti.cli.main import main
from fti.hil.truth_log import END_TOPIC, LATE_TOPIC, MEASUREMENT, TOPIC
from fti.logger import schemas
from fti.logger.encoding import encode
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.messages.measurements import Measurement
from fti.messages.outputs import Output
from fti.messages.reasons import Reason
from fti.messages.tables import from_table, to_table
from fti.messages.topic_fields import fields
from fti.messages.topics import (
    ALARM_TOPIC,
    CLOCK_TOPIC,
    EVENT_TOPIC,
    HEALTH_TOPIC,
    LEDGER_TOPIC,
    NOTE_CLASSES,
    TICK_TOPIC,
    FileKind,
    Topic,
    topics,
)
from fti.messages.topics_page import page
from tests.helpers import ROOT

SESSIONS = sorted({path.parent for path in (ROOT / "tests" / "sessions").rglob("*_derived_*.mcap")})
KINDS: tuple[FileKind, ...] = ("raw", "derived", "truth")


def rows_of(topic: str) -> list[Topic]:
    """Rows of a recorded topic; ``/nav/...`` and ``/fti/...`` are no devices."""
    results = [row for row in topics() if row.matches(topic)]
    exact = [row for row in results if row.name.split("/")[1] == topic.split("/")[1]]
    return exact or results


def recorded(path: Path) -> dict[str, str]:
    """Topic -> name of its schema, as the official reader finds them in a file."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    return {c.topic: summary.schemas[c.schema_id].name if c.schema_id else "" for c in summary.channels.values()}


@pytest.mark.parametrize("session", SESSIONS, ids=lambda path: path.parent.name)
def test_every_recorded_topic_has_a_row(session: Path) -> None:
    count = 0
    for kind in KINDS:
        for path in SessionFolder(session).files(kind):
            for topic, schema in recorded(path).items():
                (row,) = rows_of(topic)
                assert kind in row.files, topic
                assert row.schema == schema, topic
                count += 1
    assert count > 20


@pytest.mark.parametrize("session", SESSIONS, ids=lambda path: path.parent.name)
def test_every_recorded_note_fits_its_schema_and_is_its_class(session: Path) -> None:
    """Read into its class and written again, a note has the same bytes."""
    recording, found = Recording.open(session), set()
    validators = {
        t: jsonschema.Draft7Validator(json.loads(schemas.note_schema(t).data)) for t in (*NOTE_CLASSES, EVENT_TOPIC)
    }
    for topic, _, _, _, data in [item for kind in ("raw", "derived") for item in recording.messages(kind=kind)]:
        if not topic.startswith("/fti/") or topic == TICK_TOPIC:
            continue
        found.add(topic)
        note = json.loads(data)
        validators[topic].validate(note)
        if topic != EVENT_TOPIC:
            assert encode(to_table(from_table(NOTE_CLASSES[topic], note))) == data
    assert found >= {EVENT_TOPIC, HEALTH_TOPIC, LEDGER_TOPIC, CLOCK_TOPIC, ALARM_TOPIC}


def open_tables(schema: Any, path: str) -> Iterator[str]:
    """Objects of a schema that do not say what they hold."""
    if isinstance(schema, dict):
        if schema.get("type") == "object" and not schema.get("properties") and "additionalProperties" not in schema:
            yield path
        for name, inner in schema.items():
            yield from open_tables(inner, f"{path}.{name}")


@pytest.mark.parametrize("topic", NOTE_CLASSES)
def test_a_schema_describes_all_that_a_note_holds(topic: str) -> None:
    schema = json.loads(schemas.note_schema(topic).data)
    assert list(open_tables(schema, topic)) == []
    assert schema["required"][0] == "t_ns" and not set(schema["required"]) & {"complete", "since_ns"}
    (row,) = rows_of(topic)
    assert row.content is NOTE_CLASSES[topic]


@pytest.mark.parametrize("topic", [TOPIC, LATE_TOPIC, END_TOPIC, f"{MEASUREMENT}gnss"])
def test_topics_of_the_truth_have_a_row(topic: str) -> None:
    (row,) = rows_of(topic)
    assert row.files == ("truth",)


def test_there_are_sessions() -> None:
    assert len(SESSIONS) >= 5


def test_names_are_different_and_every_class_has_a_topic() -> None:
    names = [row.name for row in topics()]
    assert len(set(names)) == len(names)
    assert {row.content for row in topics()} >= {*typing.get_args(Measurement), *typing.get_args(Output)}


@pytest.mark.parametrize("row", [row for row in topics() if row.bus], ids=lambda row: row.name)
def test_a_topic_of_the_bus_has_a_shape(row: Topic) -> None:
    assert shape_of(row.bus.replace("<altimeter>", "radar").replace("<source>", "gnss")) not in (None, ANY_OUTPUT)


@pytest.mark.parametrize("row", [row for row in topics() if row.content and row.schema.startswith("fti.")])
def test_fields_are_those_of_the_schema(row: Topic) -> None:
    assert row.content is not None
    properties = json.loads(schemas.schema_of(row.content).data)["properties"]
    assert list(dict.fromkeys(field.name.partition(".")[0] for field in fields(row.content))) == list(properties)
    plain = {field.name: field.unit for field in fields(row.content) if "." not in field.name}
    stated = {name: properties[name].get("description", "[]")[1:-1] for name in plain}
    assert stated == plain


def test_the_page_is_up_to_date() -> None:
    text = (ROOT / "docs" / "topics.md").read_text(encoding="utf-8")
    assert page() == text, "docs/topics.md is not up to date: make docs"
    assert "](topics.md)" in (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_the_command_lists_and_describes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["topics"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert len(listed) == len(topics())
    assert main(["topics", "/ins/attitude"]) == 0
    described = capsys.readouterr().out
    assert "  roll_sd                  number or null                           rad" in described.splitlines()
    assert main(["topics", "/health", "--json"]) == 0
    (health,) = json.loads(capsys.readouterr().out)
    assert (health["name"], health["files"]) == ("/fti/health", ["raw"])
    assert {"name": "links.<name>.rate_hz", "type": "number, may be absent", "unit": "Hz"} in health["fields"]


def test_the_command_lists_the_reasons(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("Reason", "reason", "REASON"):
        assert main(["topics", name]) == 0
        rows = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()]
        assert {row[0] for row in rows} == set(Reason)
        assert ["gaps", "gaps in the window"] in rows
    assert main(["topics", "Reason", "--json"]) == 0
    assert {"reason": "gaps", "text": "gaps in the window"} in json.loads(capsys.readouterr().out)


def test_an_unknown_topic_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["topics", "/nowhere"]) == 2
    assert "no topic '/nowhere'; fti topics lists them" in capsys.readouterr().err
