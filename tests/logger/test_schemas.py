from __future__ import annotations

import json
import typing
from typing import Any

import jsonschema
import pytest
from foxglove import messages as well_known
from hypothesis import given, settings
from hypothesis import strategies as st

from fti.logger import foxglove, schemas
from fti.logger.encoding import encode
from fti.messages.measurements import Attitude, Measurement, Stamp, TimeScale
from fti.messages.outputs import Event, HeightAboveGround, NavSolution, Output

CLASSES: list[type] = [*typing.get_args(Measurement), *typing.get_args(Output)]
NOTES = ["/fti/clock", "/fti/ledger", "/fti/health", "/fti/gap", "/fti/event", "/fti/alarm", "/fti/alarm_report"]


def check_for_viewer(schema: dict[str, Any], path: str) -> None:
    """The rules by which Foxglove Studio's parseJsonSchema (open source until 2024) takes a schema or throws."""
    assert schema["type"] == "object", path
    for name, field in schema["properties"].items():
        where = f"{path}.{name}"
        if "oneOf" in field:
            assert all(isinstance(choice["const"], int) for choice in field["oneOf"]), where
            continue
        assert field["type"] in ("boolean", "string", "number", "integer", "object", "array"), where
        if field["type"] == "object":
            check_for_viewer(field, where)
        if field["type"] == "array":
            assert field["items"]["type"] in ("boolean", "string", "number", "integer", "object"), where
            if field["items"]["type"] == "object":
                check_for_viewer(field["items"], where)


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_schemas_suit_validators_and_viewers(cls: type) -> None:
    schema = json.loads(schemas.schema_of(cls).data)
    jsonschema.Draft7Validator.check_schema(schema)
    check_for_viewer(schema, cls.__name__)
    assert schema["title"] == schemas.schema_of(cls).name == f"fti.{cls.__name__}"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({}, schema)


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
@settings(max_examples=20)
@given(data=st.data())
def test_every_value_fits_its_schema(cls: type, data: st.DataObject) -> None:
    value = data.draw(st.builds(cls, **{name: st.from_type(hint) for name, hint in typing.get_type_hints(cls).items()}))
    text = encode(value)
    jsonschema.validate(json.loads(text), json.loads(schemas.schema_of(cls).data))
    assert encode(value) == text


@pytest.mark.parametrize("topic", NOTES)
def test_notes_suit_viewers(topic: str) -> None:
    schema = json.loads(schemas.note_schema(topic).data)
    jsonschema.Draft7Validator.check_schema(schema)
    check_for_viewer(schema, topic)


def test_wrong_values_do_not_fit() -> None:
    good = json.loads(encode(Attitude(stamp=Stamp(1, 2, TimeScale.GPS), roll=0.1)))
    schema = json.loads(schemas.schema_of(Attitude).data)
    jsonschema.validate(good, schema)
    for wrong in (
        {"roll": "left"},
        {"valid": None},
        {"stamp": None},
        {"stamp": {**good["stamp"], "time_scale": "tai"}},
    ):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**good, **wrong}, schema)


# --------------------------------------------------------------------------------------------------------- Foxglove


@pytest.mark.parametrize("name", foxglove.NAMES)
def test_well_known_schemas_agree_with_the_sdk(name: str) -> None:
    """Every field and enumeration name of ours stands in the SDK's own (protobuf) schema."""
    theirs = getattr(well_known, {"GeoJSON": "GeoJson"}.get(name, name)).get_schema()
    ours = json.loads(schemas.foxglove_schema(name).data)
    assert theirs.name == ours["title"] == schemas.foxglove_schema(name).name
    for field, schema in ours["properties"].items():
        assert bytes([len(field)]) + field.encode() in theirs.data, field
        for choice in schema.get("oneOf", ()):
            value = bytes([0x10, choice["const"]])  # EnumValueDescriptorProto.number, field 2
            assert bytes([len(choice["title"])]) + choice["title"].encode() + value in theirs.data, choice
    check_for_viewer(ours, name)


@pytest.mark.parametrize(("level", "number"), [("info", 2), ("warning", 3), ("error", 4), ("shout", 0)])
def test_events_become_log_messages(level: str, number: int) -> None:
    event = Event(t_ns=3_000_000_007, level=level, source="radar", text="ready")
    entry = foxglove.log(event)
    assert entry["timestamp"] == {"sec": 3, "nsec": 7} and entry["level"] == number
    jsonschema.validate(entry, json.loads(schemas.foxglove_schema("Log").data))


def test_a_fix_without_sigma_has_an_unknown_covariance() -> None:
    solution = NavSolution(t_ns=1, t_valid_ns=None, valid=True, reasons=(), lat=0.1, lon=0.2, alt=3.0)
    fix = foxglove.location(solution)
    assert fix and fix["position_covariance_type"] == 0 and fix["position_covariance"] == [0.0] * 9
    jsonschema.validate(fix, json.loads(schemas.foxglove_schema("LocationFix").data))


def test_no_fix_without_position() -> None:
    assert foxglove.location(NavSolution(t_ns=1, t_valid_ns=None, valid=True, reasons=(), lat=0.1, lon=0.2)) is None


def test_a_stray_byte_of_a_command_line_is_no_obstacle() -> None:
    event = {"t_ns": 1, "level": "info", "source": "mark", "text": "bad \udcff mark"}
    assert json.loads(schemas.encode_note("/fti/event", event))["message"] == "bad ? mark"


def test_a_schema_says_of_which_version_the_meaning_of_a_height_is() -> None:
    assert "height_agl" in schemas.json_schema(HeightAboveGround)["description"]
    assert "description" not in schemas.json_schema(NavSolution)
