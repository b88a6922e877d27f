"""Elevation larger than memory in flight: squares around the position, in a thread; a flight with them, and again."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fti import config as configuration
from fti.config import Config, TerrainFiles
from fti.errors import RecordingError
from fti.logger.reading.recording import Recording
from fti.messages.outputs import NavSolution
from fti.messages.topics import TERRAIN_TOPIC
from fti.post.reprocess import Setup, TerrainNote, other_setup, recorded_setup, reprocess
from fti.service.navigation.terrain_areas import TerrainAreaLoader, TerrainAreas
from fti.terrain.files import catalogue, resampling_error
from tests.helpers import until
from tests.post.score.short_flight import CONFIG, session_of, short_scenario
from tests.terrain.elevation_files import from_origin, write_tif

#: The airfield of the small world [deg].
LAT, LON = 48.0, 11.0
#: 100 files and more could not be one terrain; these are 36.
TILES, TILE_DEG = 6, 0.02


@pytest.fixture(scope="module", autouse=True)
def _few_comparisons() -> Iterator[None]:
    """The error of resampling is measured in few blocks: it takes most of the time to load a small square."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(resampling_error, "_BLOCKS", 4)
        yield


@pytest.fixture(scope="module")
def tiles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Level tiles of 2.2 km x 1.5 km, posts 22 m and 15 m apart, 6 km to each side of the airfield."""
    folder = tmp_path_factory.mktemp("tiles")
    for row in range(TILES):
        for column in range(TILES):
            corner = from_origin(
                LON + (column - TILES / 2) * TILE_DEG,
                LAT + (TILES / 2 - row) * TILE_DEG,
                TILE_DEG / 100,
                TILE_DEG / 100,
            )
            write_tif(folder / f"{row}_{column}.tif", np.full((100, 100), 500.0), "EPSG:4326", corner)
    return folder


def settings(folder: Path) -> dict[str, Any]:
    """Half a side of 1.1 km: 5 m between posts, 16 MB."""
    return {"files": (str(folder),), "vertical": "ellipsoid", "memory_mb": 16.0, "cell_m": 5.0}


def nav_at(lat_deg: float, lon_deg: float, north: float = 0.0, east: float = 0.0) -> NavSolution:
    return NavSolution(
        t_ns=0, t_valid_ns=0, valid=True, reasons=(), vel_north=north, vel_east=east,
        lat=math.radians(lat_deg), lon=math.radians(lon_deg),
    )  # fmt: skip


def test_the_first_square_is_around_the_aircraft_and_the_next_one_ahead(tiles: Path) -> None:
    areas = TerrainAreas(TerrainFiles(**settings(tiles)))
    assert not areas.is_wanted(NavSolution(t_ns=0, t_valid_ns=None, valid=False, reasons=()))
    first = areas.load(nav_at(LAT, LON)).ground
    assert first and first.radius_m == pytest.approx(1105.0, abs=1.0) and 1 < len(first.files) < 9
    assert np.isfinite(first.terrain.up([-1100.0, 1100.0], [-1100.0, 1100.0])).all()
    near, far = nav_at(LAT + 0.004, LON), nav_at(LAT + 0.006, LON, north=60.0)  # 450 m and 670 m
    assert not areas.is_wanted(near) and areas.is_wanted(far)
    second = areas.load(far).ground
    assert second and math.degrees(second.terrain.frame.lat0) == pytest.approx(
        LAT + 0.006 + 368.0 / 111_200.0, abs=1e-4
    )
    assert second.name.startswith("1.1 km around 48.0093, 11.0000, files: ")


def test_a_place_without_files_is_a_fault_and_is_tried_again_elsewhere(tiles: Path) -> None:
    areas = TerrainAreas(TerrainFiles(**settings(tiles)))
    lost = areas.load(nav_at(LAT + 3.0, LON))
    assert lost.ground is None and "no elevation file within" in str(lost.fault)
    assert not areas.is_wanted(nav_at(LAT + 3.01, LON))
    assert areas.is_wanted(nav_at(LAT, LON)) and areas.load(nav_at(LAT, LON)).ground


def bound(folder: Path) -> tuple[Config, TerrainFiles]:
    config = configuration.bind(Config, {"session": {"name": "t"}, "nav": {"terrain": settings(folder)}}, "t.toml")
    assert config.nav.terrain
    return config, config.nav.terrain


def test_the_thread_loads_one_square_at_a_time(tiles: Path) -> None:
    loader = TerrainAreaLoader(*bound(tiles))
    assert loader.state == "waits for a position" and loader.take() is None and not loader.is_done
    for lat in (LAT, LAT + 0.01):
        assert loader.follow(nav_at(lat, LON)) and not loader.follow(nav_at(lat, LON))
        until(lambda: loader._result is not None, 120.0, "the square")
        taken = loader.take()
        assert taken and taken.ground and loader.take() is None and loader.is_done
        assert not loader.follow(nav_at(lat, LON))
        assert loader.state == taken.ground.name


def test_an_error_of_a_library_is_a_fault_and_the_thread_goes_on(tiles: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*args: object, **more: object) -> None:
        raise OSError("the disk is away")

    loader = TerrainAreaLoader(*bound(tiles))
    with monkeypatch.context() as broken:
        broken.setattr(catalogue, "read_catalogue", fail)
        loader.follow(nav_at(LAT, LON))
        until(lambda: loader._result is not None, 120.0, "the fault")
    taken = loader.take()
    assert taken and taken.ground is None and "the disk is away" in str(taken.fault)
    assert loader.follow(nav_at(LAT, LON))
    until(lambda: loader._result is not None, 120.0, "the square")


def test_navigation_that_ended_while_loading_has_no_squares(tiles: Path) -> None:
    loader = TerrainAreaLoader(*bound(tiles), "navigation ended 3 times while it was loaded")
    taken = loader.take()
    assert taken and taken.ground is None and taken.fault and not loader.follow(nav_at(LAT, LON))


# ------------------------------------------------------------------------------------------------- a flight, and again


@pytest.fixture(scope="module")
def session(tiles: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An approach of 38 s over the tiles."""
    folder = tmp_path_factory.mktemp("flight")
    values = ", ".join(f"{key} = {json.dumps(value)}" for key, value in settings(tiles).items())
    return session_of(short_scenario(()), folder, f"{CONFIG}terrain = {{ {values} }}\n")


def messages(session: Path, topic: str) -> list[tuple[str, int, Any]]:
    found = Recording.open(session).messages(topic, kind="derived")
    return [(name, t_ns, json.loads(data)) for name, t_ns, _, _, data in found]


def again(session: Path, out: Path, setup: Setup | None = None) -> Path:
    recording = Recording.open(session)
    setup = setup or recorded_setup(recording, session)
    return reprocess(recording, setup, out, as_flown=True, progress=lambda seq: None)


def test_a_flight_has_several_squares_and_reprocessing_repeats_it(session: Path, tmp_path: Path) -> None:
    notes = [note for *_, note in messages(session, TERRAIN_TOPIC)]
    assert len(notes) >= 3 and all(note["radius"] < 2000.0 and note["checksums"] for note in notes)
    assert len({(note["lat"], note["lon"]) for note in notes}) == len(notes)
    reasons = [reason for _, _, row in messages(session, "/nav/height_above_ground/") for reason in row["unchecked"]]
    assert "terrain_edge" not in reasons and reasons.count("terrain_loading") < 50
    repeated = again(session, tmp_path)
    for topic in (TERRAIN_TOPIC, "/nav/", "/fti/event"):
        assert messages(repeated, topic) == messages(session, topic), topic


def test_without_the_notes_of_the_flight_the_squares_are_chosen_again(session: Path, tmp_path: Path) -> None:
    setup = other_setup(str(session.parent.parent / "short.toml"))
    repeated = again(session, tmp_path, setup)
    assert [note for *_, note in messages(repeated, TERRAIN_TOPIC)] == [
        note for *_, note in messages(session, TERRAIN_TOPIC)
    ]


def test_a_square_of_other_posts_is_refused(session: Path, tmp_path: Path) -> None:
    setup = recorded_setup(Recording.open(session), session)
    first, second, *rest = setup.terrain_notes
    changed = TerrainNote(second.after_seq, second.t_ns, second.sha256, (1.0,), None, second.area)
    setup = Setup(
        setup.config, setup.texts, setup.devices, setup.reference, (first, changed, *rest), recorded=True
    )  # fmt: skip
    with pytest.raises(RecordingError, match="is not the terrain of the flight"):
        again(session, tmp_path, setup)
