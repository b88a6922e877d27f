"""The terrain of navigation: loaded in a separate thread, with a state."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fti import config as configuration
from fti.config import Config, TerrainFiles
from fti.messages.control import TerrainLoading
from fti.messages.notes import TerrainRecord
from fti.nav.terrain_reference import Ground
from fti.service.navigation.decode_chain import Chain
from fti.service.navigation.terrain_loader import TerrainLoader, load_terrain
from fti.service.terrain_retry import TerrainRetry
from tests.helpers import until
from tests.terrain.elevation_files import LAT, LON, from_origin, write_dted, write_ground, write_tif


def _config(**terrain: Any) -> Config:
    return configuration.bind(Config, {"session": {"name": "t"}, "nav": {"terrain": terrain}}, "t.toml")


def test_it_is_handed_over_once_and_is_the_same_as_loaded_at_once() -> None:
    loading = TerrainLoader(_config(scene="demo"))
    assert loading.take() is None
    assert loading.state.startswith("loading")
    loading.start()
    until(lambda: loading._result is not None, 60.0, "the ground")
    loaded = loading.take()
    assert loaded is not None
    assert loaded.ground is not None
    assert loaded.ground.digest == load_terrain(TerrainFiles(scene="demo")).digest
    assert loading.take() is None
    assert loading.state == "scene demo"


def test_files_that_are_not_there_are_a_fault_in_words_and_no_exception() -> None:
    loading = TerrainLoader(_config(files=["/no/such.tif"], vertical="egm96"))
    loading.start()
    until(lambda: loading._result is not None, 60.0, "the fault")
    loaded = loading.take()
    assert loaded is not None
    assert loaded.ground is None
    assert "/no/such.tif" in str(loaded.fault)
    assert loading.state.startswith("not available")


def test_tables_of_files_have_precedence_over_what_a_file_states(tmp_path: Path) -> None:
    """Western half: DTED with an accuracy of 10 m; eastern half: the same, and what the table states of it."""

    def level(lat: NDArray[np.float64], lon: NDArray[np.float64]) -> NDArray[np.float64]:
        return 500.0 + 0.0 * lat * lon

    for name in ("w", "e"):
        (tmp_path / name).mkdir()
    west, east = (
        write_dted(tmp_path / name, level, west=degrees, tags={"DTED_VerticalAccuracy_ACC": "0010"})
        for name, degrees in (("w", 11), ("e", 12))
    )
    table = {"path": f"{tmp_path}/e/*", "vertical": "ellipsoid", "sd_m": 0.5, "date": "2021"}
    config = _config(
        files=[west, east], vertical="egm96", centre_deg=(47.5, 12.0), radius_m=5000.0, cell_m=500.0, file=[table]
    )
    assert config.nav.terrain
    ground = load_terrain(config.nav.terrain)
    step_m = ground.terrain.resampling[0].rms_m  # between the datums, from post to post
    expected = [math.hypot(sd_m, step_m) for sd_m in (10.0 / 1.6449, 0.5)]
    assert [ground.sd_at(place, 0.0) for place in (-3000.0, 3000.0)] == pytest.approx(expected, abs=1e-3)
    (of_west, of_east) = ground.terrain.sources
    assert (of_west.vertical, of_east.vertical, of_east.date) == ("egm96", "ellipsoid", "2021")
    (note, _) = Chain(config, [], None).set_terrain(ground, None, 0, 0).notes
    assert isinstance(note, TerrainRecord) and note.sources
    assert [(each.file, each.vertical, each.date, round(each.sd, 1)) for each in note.sources] == [
        (west, "egm96", None, 6.1),
        (east, "ellipsoid", "2021", 0.5),
    ]


def test_land_cover_changes_what_an_altimeter_measures_and_not_the_ground(tmp_path: Path) -> None:
    elevation = write_ground(tmp_path / "dtm.tif", lambda lat, lon: 500.0 + 0.0 * lat * lon, "EPSG:32632", 40, 50.0)
    woods = np.full((40, 40), 10, dtype=np.uint8)
    cover = write_tif(tmp_path / "cover.tif", woods, "EPSG:4326", from_origin(LON - 0.1, LAT + 0.1, 0.005, 0.005))
    table = {"classes": [10], "altimeter": "laser", "bias_m": 17.0, "sd_m": 5.0}
    config = _config(files=[elevation], vertical="ellipsoid", memory_mb=100, land_cover=cover, cover=[table])
    assert config.nav.terrain
    assert config.nav.terrain.square_mb == 50.0
    ground = load_terrain(config.nav.terrain)
    laser = ground.sensed_by("laser")
    raised = laser.terrain.finest.heights - ground.terrain.finest.heights
    assert np.nanmin(raised) == np.nanmax(raised) == 17.0
    assert laser.sd_at(0.0, 0.0) == pytest.approx(math.hypot(5.0, ground.sd_at(0.0, 0.0)))
    assert ground.sensed_by("radar") is ground


def test_another_post_is_another_ground() -> None:
    ground = load_terrain(TerrainFiles(scene="demo"))
    heights = ground.terrain.finest.heights.copy()
    heights[7, 9] += 0.001
    other = type(ground)(ground.terrain.with_finest(heights), ground.sd, ground.name)
    assert other.digest != ground.digest


def test_checksums_tell_another_post_and_not_another_processor() -> None:
    """Last bits of the posts depend on the software version and the processor model: 1 nm here."""
    ground = load_terrain(TerrainFiles(scene="demo"))
    posts = ground.terrain.finest.heights
    changed = posts.copy()
    changed[7, 9] += 0.25
    noise = np.random.default_rng(1).uniform(-1e-9, 1e-9, posts.shape)
    assert not _with_posts(ground, changed).has_checksums(ground.checksums)
    assert _with_posts(ground, posts + noise).has_checksums(ground.checksums)
    assert not ground.has_checksums(ground.checksums[:-1])


def _with_posts(ground: Ground, heights: NDArray[np.float64]) -> Ground:
    return Ground(ground.terrain.with_finest(heights), ground.sd, ground.name)


def test_a_ground_that_navigation_did_not_live_through_is_left_out_and_the_reason_is_reported() -> None:
    loading = TerrainLoader(_config(scene="demo"), "navigation ended 3 times while it was loaded")
    loading.start()
    until(lambda: loading._result is not None, 60.0, "the fault")
    loaded = loading.take()
    assert loaded is not None
    assert loaded.ground is None
    assert loading.state == "not available: navigation ended 3 times while it was loaded"


def test_what_cannot_even_be_imported_is_a_fault_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fti.nav.kernel_warmup", None)
    loading = TerrainLoader(_config(scene="demo"))
    loading.start()
    until(lambda: loading._result is not None, 60.0, "the fault")
    loaded = loading.take()
    assert loaded is not None
    assert "ModuleNotFoundError" in str(loaded.fault)


def test_the_sum_over_its_posts_is_there_with_the_ground() -> None:
    loading = TerrainLoader(_config(scene="demo"))
    loading.start()
    until(lambda: loading._result is not None, 60.0, "the ground")
    loaded = loading.take()
    assert loaded is not None
    assert "digest" in vars(loaded.ground)


def test_three_ends_while_it_is_loaded_are_enough_and_others_do_not_count() -> None:
    trial = TerrainRetry()
    assert trial.on_exit() is None
    for _ in range(2):
        trial.on_loading(TerrainLoading(True))
        assert trial.on_exit() is None
    assert trial.on_exit() is None  # it had not begun to load
    trial.on_loading(TerrainLoading(True))
    assert trial.on_exit() == "navigation ended 3 times while it was loaded"


def test_a_ground_that_came_in_the_end_makes_up_for_ends_before() -> None:
    trial = TerrainRetry()
    for _ in range(5):
        trial.on_loading(TerrainLoading(True))
        assert trial.on_exit() is None
        trial.on_loading(TerrainLoading(True))
        trial.on_loading(TerrainLoading(False))
        assert trial.on_exit() is None
