"""The ground of navigation: loaded beside it, and said whether it is there."""

from __future__ import annotations

import sys
from typing import Any

import pytest

from fti import config as configuration
from fti.config import Config, TerrainFiles
from fti.service.ground import GroundLoading, load_ground
from fti.service.terrain_trial import DONE, LOADING, TerrainTrial
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
    assert loaded.ground.digest == load_ground(TerrainFiles(scene="demo")).digest
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
    assert other.digest != ground.digest


def test_a_ground_that_navigation_did_not_live_through_is_left_out_and_it_is_said_why() -> None:
    loading = GroundLoading(_config(scene="demo"), "navigation ended 3 times while it was loaded")
    loading.start()
    until(lambda: loading._found is not None, 60.0, "the fault")
    loaded = loading.take()
    assert loaded is not None
    assert loaded.ground is None
    assert loading.state == "not there: navigation ended 3 times while it was loaded"


def test_what_cannot_even_be_imported_is_a_fault_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fti.nav.warm", None)
    loading = GroundLoading(_config(scene="demo"))
    loading.start()
    until(lambda: loading._found is not None, 60.0, "the fault")
    loaded = loading.take()
    assert loaded is not None
    assert "ModuleNotFoundError" in str(loaded.fault)


def test_the_sum_over_its_posts_is_there_with_the_ground() -> None:
    loading = GroundLoading(_config(scene="demo"))
    loading.start()
    until(lambda: loading._found is not None, 60.0, "the ground")
    loaded = loading.take()
    assert loaded is not None
    assert "digest" in vars(loaded.ground)


def test_three_ends_while_it_is_loaded_are_enough_and_others_do_not_count() -> None:
    trial = TerrainTrial()
    assert trial.ended() is None
    for _ in range(2):
        trial.hear({"terrain": LOADING})
        assert trial.ended() is None
    assert trial.ended() is None  # it had not begun to load
    trial.hear({"terrain": LOADING})
    assert trial.ended() == "navigation ended 3 times while it was loaded"


def test_a_ground_that_came_in_the_end_makes_up_for_ends_before() -> None:
    trial = TerrainTrial()
    for _ in range(5):
        trial.hear({"terrain": LOADING})
        assert trial.ended() is None
        trial.hear({"terrain": LOADING})
        trial.hear({"terrain": DONE})
        assert trial.ended() is None
