"""From a scenario to its flight: every kind, and what is wrong in its table."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from fti.errors import ConfigError
from fti.hil import scenario as scenarios
from fti.hil.environment import Environment
from fti.hil.flight.factory import MAKERS
from fti.hil.flight.recorded_flight import read_table, write_table
from fti.hil.flight.smoothing import displacements
from fti.hil.flight.trajectory import FlightSamples
from fti.hil.tables.flights import AnyFlight
from tests.hil.flight import recordings
from tests.hil.worlds import flat_terrain, path, scenario

EAST = {"lat_deg": 48.0, "lon_deg": 11.05, "alt_m": 700, "speed_mps": 60}
WEST = {"lat_deg": 48.0, "lon_deg": 10.95, "alt_m": 700, "speed_mps": 60}
HEADER = 'title = "t"\ndescription = ""\nconfig = "demo.toml"\n'


def line(**keys: object) -> dict[str, object]:
    return {"kind": "waypoints", "waypoint": (EAST, WEST), **keys}


def world(flight: dict[str, object], **keys: object) -> Environment:
    return Environment(scenario(flight=flight, **keys), path(), flat_terrain(100.0), undulation=47.0)


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "s.toml"
    file.write_text(HEADER + text)
    return file


def straight(tmp_path: Path, t: np.ndarray, shake: float = 0.0) -> Path:
    """A recording of level flight to the west at 60 m/s, 700 m, with so much noise in its height."""
    lon = np.deg2rad(11.03) - 60.0 * t / 6.37e6 / np.cos(np.deg2rad(48.0))
    alt = 700.0 + np.random.default_rng(2).normal(0.0, shake, len(t))
    level = 0.0 * t
    file = tmp_path / "flight.csv"
    write_table(
        FlightSamples(t, level + np.deg2rad(48.0), lon, alt, level, level, level + np.deg2rad(270.0)), file, ["made up"]
    )
    return file


def test_every_kind_has_a_maker() -> None:
    assert set(MAKERS) == set(get_args(AnyFlight))


def test_a_table_without_a_kind_is_an_approach() -> None:
    assert scenario(flight={"duration_s": 20}).flight.kind == "approach"
    assert world({"duration_s": 20}).duration == 20.0


def test_waypoints_are_flown_in_the_wind_of_the_scenario() -> None:
    there = world(line(), air={"wind_mps": 6, "wind_from_deg": 270})
    state = there.state(np.array([0.0, 30.0, there.duration]))
    np.testing.assert_allclose(np.rad2deg(state.lon[[0, -1]]), [11.05, 10.95], atol=1e-6)
    np.testing.assert_allclose(state.tas, 66.0, atol=0.1)
    assert there.remarks == ()
    assert there.ground(state)[1] == pytest.approx(500.0, abs=1.0)  # level with the threshold is higher further out


def test_a_recording_is_flown_from_where_it_is_asked_for(tmp_path: Path) -> None:
    file = straight(tmp_path, np.arange(0.0, 60.0, 0.2))
    there = world({"kind": "recorded", "file": str(file), "from_s": 10, "duration_s": 30})
    assert there.duration == 30.0
    state = there.state(np.array([0.0, 30.0]))
    assert np.ptp(state.lon) * 6.37e6 * np.cos(state.lat[0]) == pytest.approx(1800.0, abs=2.0)
    full = world({"kind": "recorded", "file": str(file)}).state(np.array([10.0]))
    assert full.lon[0] == pytest.approx(state.lon[0], abs=1e-12)
    assert there.remarks[0].startswith("flight.csv: filtered minus recorded: 0 m")


@pytest.mark.parametrize(
    ("keys", "error"),
    [
        (
            {"from_s": 58, "duration_s": 10},
            r"flight\.csv: 0\.0 to 10\.0 s is not within the flight of -58\.000 to 1\.800 s",
        ),
        ({"smooth_s": 0.3}, r"flight\.csv: samples 0\.200 s apart cannot be smoothed over 0\.300 s"),
    ],
)
def test_missing_parts_of_a_recording_are_reported(tmp_path: Path, keys: dict[str, object], error: str) -> None:
    file = straight(tmp_path, np.arange(0.0, 60.0, 0.2))
    with pytest.raises(ConfigError, match=error):
        world({"kind": "recorded", "file": str(file), **keys})


def test_a_gap_in_a_recording_is_reported(tmp_path: Path) -> None:
    t = np.arange(0.0, 60.0, 0.2)
    file = straight(tmp_path, t[(t < 20.0) | (t > 25.0)])
    with pytest.raises(ConfigError, match=r"flight\.csv: no samples of the flight from 19\.800 s to 25\.200 s"):
        world({"kind": "recorded", "file": str(file)})


def test_a_recording_that_shakes_is_refused_until_it_is_smoothed(tmp_path: Path) -> None:
    file = straight(tmp_path, np.arange(0.0, 60.0, 0.1), shake=0.5)
    with pytest.raises(ConfigError, match=r"acceleration of \d+ m/s\^2 at .* increase flight\.smooth_s \(now none\)"):
        world({"kind": "recorded", "file": str(file)})
    assert world({"kind": "recorded", "file": str(file), "smooth_s": 3}).duration > 58.0


def test_a_file_is_beside_its_scenario(tmp_path: Path) -> None:
    file = written(tmp_path, '[flight]\nkind = "recorded"\nfile = "x/flight.csv"\n')
    flight = scenarios.load(file).flight
    assert flight.kind == "recorded"
    assert flight.file == str(tmp_path / "x" / "flight.csv")


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (
            '[flight]\nkind = "ballistic"\n',
            r"flight\.kind: unknown kind 'ballistic'; allowed: approach, waypoints, recorded",
        ),
        ('[flight]\nkind = "recorded"\n', r"flight\.file: missing"),
        ('[flight]\nkind = "waypoints"\nwaypoint = []\n', r"flight\.waypoint = \(\): .*at least 2"),
        ('[flight]\nkind = "waypoints"\nspeed_mps = 3\n', r"flight\.speed_mps: there is no such key; .*bank_deg, kind"),
        (
            '[flight]\nkind = "waypoints"\nwaypoint = [{lat_deg = 95, lon_deg = 0, alt_m = 0, speed_mps = 1}]\n',
            r"flight\.waypoint\[0\]\.lat_deg = 95",
        ),
        (
            '[flight]\nkind = "recorded"\nfile = "f"\n[[fault]]\nkind = "off_track"\nright_m = 9\nfrom_s = 0\nto_s = 9',
            r"fault\[0\]\.kind = 'off_track': needs flight.kind = 'approach'",
        ),
    ],
)
def test_mistakes_in_a_table_are_named(tmp_path: Path, text: str, error: str) -> None:
    with pytest.raises(ConfigError, match=error):
        scenarios.load(written(tmp_path, text))


@pytest.mark.parametrize(
    "text",
    [
        "[flight]\nspeed_mps = 0.5",
        "[flight]\nspeed_mps = 301",
        "[flight]\nduration_s = 14401",
        "[air]\nwind_mps = 101",
        '[[fault]]\nkind = "off_track"\nfrom_s = 0\nto_s = 9\nright_m = 1e9',
    ],
)
def test_what_no_flight_can_be_computed_for_is_refused_by_its_key(tmp_path: Path, text: str) -> None:
    key = text.split()[-3]
    with pytest.raises(ConfigError, match=rf"{key} = .*: input should be (less|greater) than or equal to \d+"):
        scenarios.load(written(tmp_path, text))


def test_a_flight_of_hours_on_end_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"test: flight\.waypoint: \d+ s from the first to the last; at most 14400 s"):
        world(line(waypoint=({**EAST, "speed_mps": 2}, {**WEST, "lat_deg": 49, "speed_mps": 2})))


def test_turns_without_room_are_named_by_the_scenario() -> None:
    corner = {**EAST, "lon_deg": 10.951, "lat_deg": 48.003}
    with pytest.raises(ConfigError, match=r"test: flight\.waypoint\[1\] and waypoint\[2\] are \d+ m apart"):
        world(line(waypoint=(EAST, WEST, corner)))


def test_a_flight_that_leaves_the_terrain_is_reported_and_has_no_ranges_there() -> None:
    there = world(line(waypoint=({**EAST, "lon_deg": 11.2}, WEST)))
    assert there.remarks[0].startswith("no terrain data below 4")
    assert "first at 0 s" in there.remarks[0]
    inside = there.ground(there.state(np.array([1.0, there.duration - 1.0])))
    np.testing.assert_array_equal(np.isnan(inside), [True, False])


def test_a_flight_below_the_ground_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"test: flight: 1\d\d m below the ground at \d+ s"):
        world(line(waypoint=(EAST, {**WEST, "alt_m": 390})))


def test_the_recording_that_is_shipped_is_the_one_that_is_made(tmp_path: Path) -> None:
    recordings.write(tmp_path / "again.csv")
    shipped, again = read_table(recordings.FILE), read_table(tmp_path / "again.csv")
    np.testing.assert_array_equal(shipped.t, again.t)
    metres, angles = displacements(shipped, again)
    assert metres.max() < 1e-3  # the last digit, on another processor
    assert np.rad2deg(angles.max()) < 1e-4
    head = recordings.FILE.read_text().splitlines()[:3]
    assert head == (tmp_path / "again.csv").read_text().splitlines()[:3]
    assert "made by this project" in head[0]
