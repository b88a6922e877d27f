"""``fti demo``: the main job in one command, and what it leaves."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import jsonschema
import pytest
from foxglove.messages import LocationFix
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema

from fti.hil.truth_log import END_TOPIC, TOPIC
from tests.e2e.harness import fti
from tests.helpers import ROOT

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]
CONFIGS = ROOT / "configs"
LINKS = ("radalt_line", "ins_eth", "air_can", "ahrs_line", "gnss_line", "mavlink_eth", "pdu_line")
OUTPUTS = ("nav_solution", "height_above_ground/altimeter", "clearance_integrity", "glide_slope", "location")


def _messages(path: Path) -> list[tuple[Schema | None, Channel, Message]]:
    """Every message of a file, read by the official reader with checksums validated."""
    return list(make_reader(io.BytesIO(path.read_bytes()), validate_crcs=True).iter_messages())


def test_the_demonstration_leaves_what_it_promises(tmp_path: Path) -> None:
    done = fti("demo", "--headless", "--duration", "12", "--out", str(tmp_path), "--run-dir", str(tmp_path / "run"))
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stdout + done.stderr
    assert re.search(r"^display at http://127\.0\.0\.1:\d+/$", done.stdout, re.MULTILINE)  # to no terminal: without key
    (session,) = tmp_path.glob("demo_*")
    (raw,) = session.glob(f"{session.name}_0*.mcap")
    (derived,) = session.glob("*_derived_000.mcap")
    (truth,) = session.glob("*_truth_000.mcap")
    topics = {channel.topic for _, channel, _ in _messages(raw)}
    assert topics >= {f"/raw/{link}" for link in LINKS} | {"/fti/tick", "/fti/clock", "/fti/ledger", "/fti/health"}
    rows = _messages(derived)
    assert {channel.topic for _, channel, _ in rows} >= {f"/nav/{name}" for name in OUTPUTS}
    _assert_schemas(rows)
    truth_messages = _messages(truth)
    assert len(truth_messages) > 100
    assert truth_messages[-1][1].topic == END_TOPIC  # the emulator has ended by itself, before what records it
    rows_ns = [message.log_time for _, channel, message in truth_messages if channel.topic == TOPIC]
    assert max(message.log_time for _, channel, message in rows if channel.topic == "/nav/nav_solution") > rows_ns[-1]
    assert fti("verify", str(session)).returncode == 0


def test_the_next_flight_begins_far_away_and_is_navigated_again(tmp_path: Path) -> None:
    """No aircraft flies back to the beginning of its approach in seconds: navigation begins anew in between."""
    approach = (CONFIGS / "scenarios" / "nominal.toml").read_text().replace("../demo.toml", str(CONFIGS / "demo.toml"))
    scenario = tmp_path / "short.toml"
    scenario.write_text(approach + '\n[flight]\nkind = "approach"\nduration_s = 9\n')
    arguments = ("--headless", "--scenario", str(scenario), "--duration", "30", "--out", str(tmp_path / "out"))
    done = fti("demo", *arguments, "--run-dir", str(tmp_path / "run"))
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stdout + done.stderr
    (session,) = (tmp_path / "out").glob("demo_*")
    (truth,) = session.glob("*_truth_001.mcap")
    rows_ns = [message.log_time for _, channel, message in _messages(truth) if channel.topic == TOPIC]
    assert rows_ns[-1] - rows_ns[0] > 7_000_000_000
    solutions = [found for file in session.glob("*_derived_*.mcap") for found in _messages(file)]
    in_flight = [
        json.loads(message.data)
        for _, channel, message in solutions
        if channel.topic == "/nav/nav_solution" and rows_ns[0] + 4_000_000_000 < message.log_time < rows_ns[-1]
    ]
    assert len(in_flight) > 50
    assert all(row["position_source"] == "ins" for row in in_flight)
    begun = [message.log_time for _, channel, message in solutions if channel.topic == "/fti/readmission"]
    assert len([t_ns for t_ns in begun if t_ns < rows_ns[0]]) == 1


def _assert_schemas(messages: list[tuple[Schema | None, Channel, Message]]) -> None:
    """Every message follows its own schema, and positions are those of Foxglove."""
    validators: dict[int, jsonschema.Draft7Validator] = {}
    for schema, _, message in messages:
        assert schema
        if schema.id not in validators:
            validators[schema.id] = jsonschema.Draft7Validator(json.loads(schema.data))
        validators[schema.id].validate(json.loads(message.data))
    names = {schema.name for schema, channel, _ in messages if schema and channel.topic == "/nav/location"}
    assert names == {LocationFix.get_schema().name}
