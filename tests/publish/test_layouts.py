"""The layouts for Foxglove and PlotJuggler: each topic and field in them exists, and the viewers know the keys."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Any

import pytest
from foxglove import layouts

from fti.example_files import FOLDER
from fti.logger.schemas import foxglove_schema, json_schema, note_schema
from fti.messages.topics import topics
from fti.publish.foxglove_scene import POSE_TOPIC, SCENE_SCHEMAS, TRACK_TOPIC

FOXGLOVE = json.loads((FOLDER / "layouts" / "foxglove.json").read_text())
PLOTJUGGLER = ET.parse(FOLDER / "layouts" / "plotjuggler.xml").getroot()
#: Types of panels in an exported layout, and the class of Foxglove's SDK that knows their keys.
PANELS: dict[str, Any] = {
    "map": layouts.MapConfig,
    "3D": layouts.ThreeDeeConfig,
    "Indicator": layouts.IndicatorConfig,
    "Plot": layouts.PlotConfig,
    "StateTransitions": layouts.StateTransitionsConfig,
    "RosOut": layouts.LogConfig,
    "RawMessages": layouts.RawMessagesConfig,
}
TITLE = "foxglovePanelTitle"
#: Topics that only the live server has; a file shows their panels empty.
ONLY_LIVE = {POSE_TOPIC, TRACK_TOPIC}


def schema_of(topic: str) -> dict[str, Any]:
    """The schema of a topic of a file or of the live server."""
    if topic in SCENE_SCHEMAS:
        return dict(json.loads(foxglove_schema(SCENE_SCHEMAS[topic]).data))
    (known,) = (each for each in topics() if each.matches(topic) and {"derived", "raw"} & {*each.files})
    if known.schema == "foxglove.Log" or topic.startswith("/fti/"):
        return dict(json.loads(note_schema(topic).data))
    assert known.content, topic
    return json_schema(known.content)


def field_type(topic: str, path: list[str]) -> str:
    """JSON type of a field; KeyError if there is none."""
    schema = schema_of(topic)
    for name in path:
        schema = schema["properties"][name]
    return str(schema["type"])


def keys_with(config: Any, names: set[str]) -> Iterator[str]:
    """All texts of these keys, at any depth."""
    for name, value in config.items() if isinstance(config, dict) else enumerate(config):
        if name in names and isinstance(value, str):
            yield value
        elif isinstance(value, dict | list):
            yield from keys_with(value, names)


def leaves(node: Any) -> list[str]:
    """The panels of a mosaic."""
    return [node] if isinstance(node, str) else [*leaves(node["first"]), *leaves(node["second"])]


def test_every_panel_has_its_place_once() -> None:
    assert sorted(leaves(FOXGLOVE["layout"])) == sorted(FOXGLOVE["configById"])


@pytest.mark.parametrize("panel", FOXGLOVE["configById"])
def test_foxglove_knows_every_key(panel: str) -> None:
    known = PANELS[panel.partition("!")[0]]()._to_dict()
    config = FOXGLOVE["configById"][panel]
    assert config.keys() - {TITLE} <= known.keys()
    parts = {"paths": layouts.PlotSeries(), "rules": layouts.IndicatorRule()}
    for name, part in parts.items():
        for each in config.get(name, ()):
            assert each.keys() <= part._to_dict().keys(), each
    for topic in config.get("topicConfig", {}).values():
        assert topic.keys() <= layouts.MapTopicSettings()._to_dict().keys()


def test_every_field_of_the_foxglove_layout_exists() -> None:
    found: set[str] = set()
    for panel, config in FOXGLOVE["configById"].items():
        for text in keys_with(config, {"value", "path", "topicPath"}):
            topic, *path = text.split(".")
            kind = field_type(topic, path)
            assert kind in ("number", "integer") or not panel.startswith("Plot"), text
            found.add(topic)
        for topic in (*keys_with(config, {"followTopic", "topicToRender"}), *config.get("topics", {})):
            schema_of(topic)
            found.add(topic)
    assert {"/nav/location", "/fti/event", "/nav/clearance_integrity", "/nav/glide_slope"} <= found
    assert {topic for topic in found if topic in ONLY_LIVE} == {POSE_TOPIC}, "a file has nothing for this panel"


def test_a_wrong_field_is_found() -> None:
    with pytest.raises(KeyError):
        field_type("/nav/glide_slope", ["dot"])
    with pytest.raises(ValueError, match="unpack"):
        field_type("/nav/no_topic", ["dots"])


def test_every_curve_of_the_plotjuggler_layout_is_a_number_of_a_file() -> None:
    curves = [curve.attrib["name"] for curve in PLOTJUGGLER.iter("curve")]
    assert len(curves) == len(set(curves)) > 20
    for name in curves:
        topic, _, field = name.rpartition("/")
        assert topic not in SCENE_SCHEMAS
        assert field_type(topic, [field]) in ("number", "boolean"), name


def test_plotjuggler_finds_as_many_plots_as_a_splitter_states() -> None:
    """It reads count and sizes before the plots."""
    splitters = list(PLOTJUGGLER.iter("DockSplitter"))
    assert splitters
    for splitter in splitters:
        assert int(splitter.attrib["count"]) == len(list(splitter)) == len(splitter.attrib["sizes"].split(";"))
        assert splitter.attrib["orientation"] in ("|", "-")
    assert [child.tag for child in PLOTJUGGLER] == ["tabbed_widget", "use_relative_time_offset"]
