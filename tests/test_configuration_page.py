"""``docs/configuration.md`` has every key of a configuration, with its default, and no other."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from fti.config import tables
from tests.helpers import ROOT

PAGE = (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8")
#: Where the table of a model stands, and the keys that it shares with the table before it.
LINK = (*tables.LinkTable.model_fields, "kind")
PLACES: dict[str, tuple[type[BaseModel], tuple[str, ...]]] = {
    "## `[session]`": (tables.Session, ()),
    "## `[snapshot]`": (tables.Snapshot, ()),
    '### `kind = "serial"`': (tables.SerialLink, LINK),
    '### `kind = "udp"`': (tables.UdpLink, LINK),
    '### `kind = "can"`': (tables.CanLink, LINK),
    "## `[[device]]`": (tables.Device, ()),
    "### `[device.altimeter]`": (tables.Altimeter, ()),
    "## `[nav]`": (tables.Nav, ()),
    "### `[nav.terrain]`": (tables.TerrainFiles, ()),
    "### `[nav.filter]`": (tables.Filter, ()),
    "### `[nav.radio]`": (tables.Radio, ()),
    "### `[nav.radio.station.NAME]`": (tables.Station, ()),
    "### `[nav.approach]`": (tables.Approach, ()),
    "### `[nav.unstated_sd]`": (tables.UnstatedSd, ()),
    "### `[nav.limits]`": (tables.SourceLimits, ()),
    "### `[nav.alert_limits]`": (tables.AlertLimits, ()),
    "| key of `[display]`": (tables.Display, ()),
    "| key of `[bus]`": (tables.Bus, ()),
    "## `[recorder]`": (tables.RecorderTuning, ()),
}


def documented(place: str) -> dict[str, str]:
    """Key to default in the first table after a place."""
    assert PAGE.count(f"\n{place}") == 1
    lines = iter(PAGE.partition(f"\n{place}")[2].splitlines())
    rows = [line for line in _first_table(lines) if line.startswith("| `")]
    cells = [[cell.strip() for cell in row.strip("|").split(" |", 2)] for row in rows]
    return {key.strip("`"): default for key, default, _ in cells}


def _first_table(lines: Any) -> list[str]:
    texts: list[str] = []
    for line in lines:
        if line.startswith("|"):
            texts.append(line)
        elif texts and not line.startswith("|"):
            break
    return texts


def expected(model: type[BaseModel], shared: tuple[str, ...]) -> dict[str, Any]:
    """Key to default; "" for a required key, "–" for an optional one without a default."""
    content: dict[str, Any] = {}
    for name, field in model.model_fields.items():
        default = field.get_default(call_default_factory=True)
        if name not in shared:
            is_table = isinstance(default, BaseModel)  # with defaults for all of its keys
            content[name] = "" if default is PydanticUndefined else "–" if default is None or is_table else default
    return content


def as_value(text: str) -> Any:
    """A default as TOML has it; "" and "–" as they are."""
    if not text.startswith("`"):
        return text
    value = tomllib.loads(f"value = {text.strip('`')}")["value"]
    return tuple(value) if isinstance(value, list) else value


@pytest.mark.parametrize("place", PLACES)
def test_every_key_is_documented_with_its_default(place: str) -> None:
    assert {key: as_value(text) for key, text in documented(place).items()} == expected(*PLACES[place])


def test_the_keys_of_every_link_are_documented() -> None:
    found = {key: as_value(text) for key, text in documented("## `[[link]]`").items()}
    assert found == {"kind": "", **expected(tables.LinkTable, ())}


def test_every_table_is_documented() -> None:
    models = {
        model
        for model in vars(tables).values()
        if isinstance(model, type) and issubclass(model, tables.StrictModel) and model.__module__ == tables.__name__
    }
    assert models - {tables.StrictModel, tables.Config, tables.LinkTable} == {model for model, _ in PLACES.values()}
