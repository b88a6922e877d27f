"""The ground of navigation: loaded beside it, and said whether it is there."""

from __future__ import annotations

from typing import Any

from fti import config as configuration
from fti.config import Config, TerrainFiles
from fti.service.ground import GroundLoading, load_ground
from tests.helpers import until


def _config(**terrain: Any) -> Config:
    return configuration.bind(Config, {"session": {"name": "t"}, "nav": {"terrain": terrain}}, "t.toml")


def test_it_is_handed_over_once_and_is_the_same_as_loaded_at_once() -> None:
    loading = GroundLoading(_config(scene="demo"))
    assert loading.take() is None
    assert loading.state.startswith("being loaded")
    loading.start()
    until(lambda: loading._found is not None, 60.0, "the ground")
    loaded = loading.take()
    assert loaded is not None
    assert loaded.ground is not None
    assert loaded.ground.digest() == load_ground(TerrainFiles(scene="demo")).digest()
    assert loading.take() is None
    assert loading.state == "scene demo"


def test_files_that_are_not_there_are_a_fault_in_words_and_no_exception() -> None:
    loading = GroundLoading(_config(files=["/no/such.tif"], vertical="egm96"))
    loading.start()
    until(lambda: loading._found is not None, 60.0, "the fault")
    loaded = loading.take()
    assert loaded is not None
    assert loaded.ground is None
    assert "/no/such.tif" in str(loaded.fault)
    assert loading.state.startswith("not there")


def test_another_post_is_another_ground() -> None:
    ground = load_ground(TerrainFiles(scene="demo"))
    heights = ground.terrain.finest.heights.copy()
    heights[7, 9] += 0.001
    other = type(ground)(ground.terrain.with_finest(heights), ground.sd, ground.name)
    assert other.digest() != ground.digest()
