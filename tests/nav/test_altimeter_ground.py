"""Refusals by the known ground, through the pipeline: what becomes of them where the ground cannot be asked.

The ground is level at 0 m, the aircraft flies north at a known height: every truth is a closed form.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from fti.config import parse
from fti.messages.measurements import Attitude, Position, RadioHeight, Range, Stamp, Velocity
from fti.messages.outputs import Event, HeightAboveGround, HeightBelowAircraft, Output
from fti.messages.reasons import Reason
from fti.nav.altimetry.deviation import DeviationMemory
from fti.nav.pipeline import Pipeline
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain

S = 1_000_000_000
HZ, SPEED_MPS = 10, 40.0
LIMITS = {"laser": {"kind": "laser", "range_m": [0.5, 500.0], "sd_m": 0.1}}
LIMITS |= {name: {"kind": "radar", "range_m": [0.5, 760.0], "sd_m": 0.4} for name in ("radar", "second_radar")}
#: Range [m] of an altimeter at a time [s].
Ranges = Callable[[float], float]


def terrain() -> Terrain:
    """Level, 4 km x 4 km."""
    latlon = {"lat0": math.radians(48.0), "lon0": math.radians(11.5)}
    return Terrain.from_array(np.zeros((401, 401)), 10.0, **latlon, east0=-2000.0, north0=-2000.0)


def pipeline(*names: str, late_s: Mapping[str, float] | None = None) -> Pipeline:
    line, late_s = {"link": "line", "driver": "x"}, late_s or {}
    config = {
        "session": {"name": "t"},
        "link": [{"name": "line", "kind": "serial", "port": "/dev/null"}],
        "device": [
            {"name": "ins", **line},
            *(
                {
                    "name": name,
                    "altimeter": LIMITS[name],
                    "latency_ms": 1e3 * late_s.get(name, 0.0),
                    "max_age_ms": 2000.0,
                    **line,
                }
                for name in names
            ),
        ],
        "nav": {"attitude": ["ins"], "position": ["ins"], "altimeters": list(names)},
    }
    outputs = Pipeline(parse(config, "", Path("t.toml")), None)
    outputs.set_terrain(Ground(terrain(), 1.0, "level"))
    return outputs


def fly(
    seconds: float, ranges: dict[str, Ranges], height_m: float, *,
    has_position: Callable[[float], bool] = lambda t: True, altitude_error_m: float = 0.0,
    altitude_sd_m: float = 2.5, north_m: float = -1800.0,
    late_s: Mapping[str, float] | None = None,
) -> Iterator[tuple[float, list[Output | Event]]]:  # fmt: skip
    """Outputs of every sample; the altimeters have a noise of 0.1 m, the sequence is always the same."""
    rng, navigation, frame = np.random.default_rng(7), pipeline(*ranges, late_s=late_s), terrain().frame
    for k in range(round(seconds * HZ)):
        t, now = k / HZ, S + k * S // HZ
        navigation.feed(
            "ins", Attitude(stamp=Stamp(now), roll=0.0, pitch=0.0, heading=0.0, roll_sd=0.003, pitch_sd=0.003)
        )
        if has_position(t):
            place = frame.to_geodetic([0.0, north_m + SPEED_MPS * t, height_m + altitude_error_m])
            lat, lon, alt = (float(x) for x in place)
            navigation.feed(
                "ins",
                Position(stamp=Stamp(now), lat=lat, lon=lon, alt=alt, horizontal_sd=1.5, vertical_sd=altitude_sd_m),
            )
            navigation.feed("ins", Velocity(stamp=Stamp(now), north=SPEED_MPS, east=0.0, down=0.0, sd=0.1))
        out = list[Output | Event]()
        for name, stated in ranges.items():
            value = round(stated(t) + rng.normal(0.0, 0.1), 2)
            if LIMITS[name]["kind"] == "laser":
                out += navigation.feed(name, Range(stamp=Stamp(now), slant_range=value))
            else:
                out += navigation.feed(name, RadioHeight(stamp=Stamp(now), height_agl=value))
        yield t, out + navigation.tick(now)


def heights(out: list[Output | Event], name: str) -> list[HeightAboveGround]:
    return [o for o in out if isinstance(o, HeightAboveGround) and o.sensor == name]


def events(out: list[Output | Event], name: str) -> list[str]:
    return [o.text for o in out if isinstance(o, Event) and o.source == name]


def valid_share(flight: list[tuple[float, list[Output | Event]]], name: str, from_s: float, to_s: float) -> float:
    """Share of its samples in a time that are valid."""
    valid = [height.valid for t, out in flight if from_s <= t < to_s for height in heights(out, name)]
    assert valid
    return sum(valid) / len(valid)


@pytest.mark.parametrize("name", ["laser", "radar"])
@pytest.mark.parametrize("height_m", [800.0, 1200.0, 2000.0])
def test_a_short_range_is_refused_where_the_ground_lies_beyond_the_range(name: str, height_m: float) -> None:
    """200 m from a cloud."""
    flight = list(fly(5.0, {name: lambda t: 200.0}, height_m, north_m=0.0))
    assert valid_share(flight, name, 0.0, 5.0) == 0.0
    assert not any(o.valid for _, out in flight for o in out if isinstance(o, HeightBelowAircraft))


def test_a_range_within_the_gate_of_the_bound_is_not_refused_by_it() -> None:
    """The ground at 760 m lies just beyond 1.5 x 500 m, and the altitude may be wrong by 2.5 m."""
    flight = list(fly(2.0, {"laser": lambda t: 745.0}, 760.0))
    assert {height.reasons for _, out in flight for height in heights(out, "laser")} == {(Reason.ABOVE_RANGE,)}


def short(t: float) -> float:
    """Fog 70 m below an aircraft that is 150 m high."""
    return 80.0 + 2.0 * math.sin(t / 2.0)


def test_who_deviates_stays_refused_when_the_position_is_lost() -> None:
    flight = list(fly(90.0, {"laser": short}, 150.0, has_position=lambda t: t < 30.0))
    assert valid_share(flight, "laser", 0.0, 90.0) == 0.0
    begins = [(t, text) for t, out in flight for text in events(out, "laser") if "deviates" in text]
    assert len(begins) == 1
    assert begins[0][0] <= 0.6
    assert "since 00:00:01.0 UTC" in begins[0][1]


def test_who_deviates_stays_refused_beyond_the_edge_of_the_terrain() -> None:
    flight = list(fly(60.0, {"laser": short}, 150.0, north_m=800.0))
    assert any(Reason.TERRAIN_EDGE in height.unchecked for _, out in flight for height in heights(out, "laser"))
    assert valid_share(flight, "laser", 0.0, 60.0) == 0.0


def test_a_short_deviation_before_the_position_is_lost_is_forgotten_soon() -> None:
    """A wood of 20 m that nobody knows, for 1.2 s: forgotten after 24 s, and fog of 12 s not within 200 s."""
    wood = {"laser": lambda t: 130.0 if 18.8 <= t < 20.0 else 150.0}
    flight = list(fly(60.0, wood, 150.0, has_position=lambda t: t < 19.6))
    assert valid_share(flight, "laser", 22.0, 30.0) == 0.0
    assert valid_share(flight, "laser", 48.0, 60.0) == 1.0
    fog = {"laser": lambda t: 80.0 if t >= 8.0 else 150.0}
    flight = list(fly(80.0, fog, 150.0, has_position=lambda t: t < 20.0))
    assert valid_share(flight, "laser", 8.0, 80.0) == 0.0


def test_who_agreed_before_the_position_was_lost_is_valid() -> None:
    """Fog for 5 s, then the ground again: 1 s of agreement ends the refusal; its change is checked for 4 s."""
    ranges = {"laser": lambda t: 80.0 if 5.0 <= t < 10.0 else 150.0}
    flight = list(fly(40.0, ranges, 150.0, has_position=lambda t: t < 15.0))
    assert valid_share(flight, "laser", 5.0, 10.0) == 0.0
    assert valid_share(flight, "laser", 14.0, 40.0) == 1.0
    ends = [t for t, out in flight for text in events(out, "laser") if "it agrees with the known ground" in text]
    assert len(ends) == 1
    assert 10.9 <= ends[0] <= 11.5


def test_who_agrees_again_is_valid_where_the_gate_is_twice_as_wide_as_its_limit() -> None:
    """An obstacle for 1.2 s, and a sigma of the altitude of 5 m: the limit is 5 m, the gate 15 m."""
    ranges = {"laser": lambda t: 70.0 if 5.0 <= t < 6.2 else 150.0}
    flight = list(fly(20.0, ranges, 150.0, altitude_sd_m=5.0))
    assert valid_share(flight, "laser", 5.0, 6.2) == 0.0
    assert valid_share(flight, "laser", 7.5, 20.0) == 1.0
    assert all(Reason.UNCERTAIN in height.unchecked for _, out in flight for height in heights(out, "laser"))


def test_where_the_gate_is_narrow_three_samples_that_agree_are_enough() -> None:
    """After an obstacle of 1.2 s; the refusal itself ends a second later, where the ground cannot be asked."""
    ranges = {"laser": lambda t: 70.0 if 5.0 <= t < 6.2 else 150.0}
    flight = list(fly(12.0, ranges, 150.0))
    assert valid_share(flight, "laser", 5.0, 6.2) == 0.0
    assert valid_share(flight, "laser", 6.5, 12.0) == 1.0


def test_who_scatters_about_its_gate_is_not_valid_sample_by_sample() -> None:
    """A laser in mist, 15 m short with 8 m of scatter: every sixth sample is within the gate of 7.5 m."""
    rng = np.random.default_rng(3)
    flight = list(fly(60.0, {"laser": lambda t: 135.0 + rng.normal(0.0, 8.0)}, 150.0))
    assert valid_share(flight, "laser", 3.0, 60.0) <= 0.02


def test_a_wood_below_a_sound_laser_does_not_free_a_wrong_radar() -> None:
    """400 m up; the radar 30 m short all the time, the laser 10 m short over a wood: not by the same amount."""
    ranges: dict[str, Ranges] = {"radar": lambda t: 370.0, "laser": lambda t: 390.0 if 10.0 <= t < 25.0 else 400.0}
    flight = list(fly(40.0, ranges, 400.0))
    assert valid_share(flight, "radar", 0.0, 40.0) == 0.0
    assert valid_share(flight, "laser", 0.0, 10.0) == 1.0


def test_time_without_a_check_does_not_count_as_deviation() -> None:
    """1.2 s of wood, 19.9 s unchecked, one tree: refused for 20 times what it deviated, not 20 times 22 s."""
    memory, now = DeviationMemory(), S

    def take(samples: int, deviates: bool | None) -> int:
        nonlocal now
        refused = 0
        for _ in range(samples):
            now += S // 10
            refused += memory.update(now, deviates)
        return refused

    take(12, True)
    assert take(199, None) == 199
    take(1, True)
    assert 20 * 1.2 <= take(2000, None) / 10 <= 20 * (1.2 + 2.5)


def test_who_is_beyond_its_limit_stays_refused_where_the_gate_is_twice_as_wide() -> None:
    """A deviation of 12 m proves nothing where the gate is 15 m, neither against the altimeter nor for it."""
    ranges = {"laser": lambda t: 70.0 if t < 6.0 else 138.0}
    flight = list(fly(20.0, ranges, 150.0, altitude_sd_m=5.0))
    assert valid_share(flight, "laser", 0.0, 20.0) == 0.0


def test_two_returns_a_second_apart_are_no_second_of_agreement() -> None:
    """Fog, in which one return in a second passes; then the position is lost, and the fog is all there is."""
    memory = DeviationMemory()
    for k in range(50):
        memory.update(S + k * S // 10, deviates=True)
    assert memory.update(8 * S, deviates=False)
    assert memory.update(10 * S, deviates=False)
    assert memory.update(10 * S + S // 10, deviates=None)


def test_an_altimeter_that_measures_once_a_second_is_refused_and_valid_again() -> None:
    """Fog for 10 s; two samples that agree are no proof, three are."""
    memory = DeviationMemory()
    found = [memory.update(round(1.02 * k * S), deviates=10 <= k < 20) for k in range(1, 30)]
    assert found == [False] * 11 + [True] * 10 + [False] * 8


def test_two_deviations_minutes_apart_are_no_refusal() -> None:
    memory = DeviationMemory()
    found = [memory.update(t_ns, deviates=True) for t_ns in (S, S + S // 10, 100 * S, 100 * S + S // 10)]
    assert found == [False] * 4


def test_a_residual_about_the_limit_ends_a_refusal_and_does_not_flap() -> None:
    """The limit is 5 m and the gate 15 m: half of the samples 5.0 +- 0.1 m off agree, and the others say nothing."""
    ranges = {"laser": lambda t: 70.0 if 5.0 <= t < 6.2 else 145.0}
    flight = list(fly(20.0, ranges, 150.0, altitude_sd_m=5.0))
    valid = [height.valid for t, out in flight if t >= 6.2 for height in heights(out, "laser")]
    assert sum(before != now for before, now in pairwise(valid)) == 1
    assert valid_share(flight, "laser", 8.5, 20.0) == 1.0


def test_single_samples_that_deviate_leave_no_memory() -> None:
    """One of 15, as at the edge of a wood."""
    ranges = {"laser": lambda t: 120.0 if round(t * HZ) % 15 == 0 else 150.0}
    flight = list(fly(40.0, ranges, 150.0, has_position=lambda t: t < 20.0))
    assert not any(events(out, "laser") for _, out in flight)
    assert valid_share(flight, "laser", 21.5, 40.0) == 1.0


UNDULATION_M = 47.0


def test_two_that_agree_against_the_ground_are_valid_with_the_relief_assumed() -> None:
    """The altitude is wrong by the undulation: the altimeters are not refused for ever."""
    ranges = {"radar": lambda t: 100.0, "laser": lambda t: 100.0}
    flight = list(fly(60.0, ranges, 100.0, altitude_error_m=UNDULATION_M))
    for name in ranges:
        assert valid_share(flight, name, 0.0, 1.9) == 0.0
        assert valid_share(flight, name, 3.0, 60.0) == 1.0
        later = [height for t, out in flight if t >= 3.0 for height in heights(out, name)]
        assert all(height.unchecked == (Reason.GROUND_CONTRADICTED,) for height in later)
        assert all(abs((height.height_agl or 0.0) - 100.0) < 3.0 * (height.sd or 0.0) for height in later)
        texts = [text for _, out in flight for text in events(out, name) if "altitude or terrain is wrong: " in text]
        assert len(texts) == 1
        assert "-47 m" in texts[0]


def test_two_that_agree_against_the_ground_are_valid_although_one_of_them_comes_later() -> None:
    ranges = {"radar": lambda t: 100.0, "laser": lambda t: 100.0}
    flight = list(fly(20.0, ranges, 100.0, altitude_error_m=UNDULATION_M, late_s={"laser": 0.8}))
    for name in ranges:
        assert valid_share(flight, name, 4.0, 20.0) == 1.0


def test_a_wrong_ground_is_wrong_where_nothing_is_predicted_too() -> None:
    """The edge of the terrain is 30 s ahead; heights beyond it say for a minute that the ground was called wrong."""
    ranges = {"radar": lambda t: 100.0, "laser": lambda t: 100.0}
    flight = list(fly(60.0, ranges, 100.0, altitude_error_m=UNDULATION_M, north_m=800.0))
    beyond = [height for t, out in flight if t >= 3.0 for name in ranges for height in heights(out, name)]
    assert any(Reason.TERRAIN_EDGE in height.unchecked for height in beyond)
    assert all(Reason.GROUND_CONTRADICTED in height.unchecked for height in beyond)


def test_deviations_alike_in_moments_far_apart_do_not_make_the_ground_wrong() -> None:
    """A radar and a laser that have returns at 5 s, and at 40 s."""
    returns: Ranges = lambda t: 53.0 if 5.0 <= t < 5.25 or 40.0 <= t < 40.35 else math.nan  # noqa: E731
    flight = list(fly(45.0, {"radar": returns, "laser": returns}, 100.0))
    assert valid_share(flight, "radar", 0.0, 45.0) == 0.0
    assert not any("altitude or terrain is wrong" in text for _, out in flight for text in events(out, "radar"))


def test_the_ground_counts_again_when_the_altitude_is_right_again() -> None:
    rng_error = {"radar": lambda t: 100.0, "laser": lambda t: 100.0}
    outputs = list(fly(20.0, rng_error, 100.0, altitude_error_m=0.0))
    assert all(height.is_by_terrain for _, out in outputs for height in heights(out, "radar"))
    lies = {"radar": lambda t: 53.0 if t < 10.0 else 100.0, "laser": lambda t: 53.0 if t < 10.0 else 100.0}
    flight = list(fly(20.0, lies, 100.0))
    before = [height for t, out in flight if 5.0 <= t < 10.0 for height in heights(out, "radar")]
    after = [height for t, out in flight if t >= 13.0 for height in heights(out, "radar")]
    assert all(not height.is_by_terrain for height in before)
    assert all(height.valid and height.is_by_terrain and not height.unchecked for height in after)


@pytest.mark.parametrize("names", [("radar", "second_radar"), ("laser", "radar")])
def test_two_that_do_not_prove_the_ground_wrong_stay_refused(names: tuple[str, str]) -> None:
    """Two of one kind may have one cause of error in common; two that differ by 20 m prove nothing."""
    second = 53.0 if names[1] == "second_radar" else 73.0
    ranges: dict[str, Ranges] = {names[0]: lambda t: 53.0, names[1]: lambda t: second}
    flight = list(fly(20.0, ranges, 100.0))
    assert all(valid_share(flight, name, 0.0, 20.0) == 0.0 for name in names)


@pytest.mark.parametrize("bias_m", [7.0, 8.0, 9.0, 9.5, 10.0, 10.5, 12.0])
def test_of_two_radars_the_one_that_is_wrong_by_about_its_gate_is_refused_steadily(bias_m: float) -> None:
    """60 m high; the gate is 10 m, 3 sigma are 8.1 m: some samples deviate, some do not.  Below, both may be wrong."""
    ranges: dict[str, Ranges] = {"radar": lambda t: 60.0 + bias_m, "second_radar": lambda t: 60.0}
    flight = list(fly(50.0, ranges, 60.0))
    assert valid_share(flight, "radar", 1.0, 50.0) == 0.0
    sound = [o.valid for t, out in flight if t >= 1.0 for o in heights(out, "second_radar")]
    assert all(sound) or bias_m <= 8.0
    assert sum(before != now for before, now in pairwise(sound)) <= 1
    assert sum(len(events(out, name)) for _, out in flight for name in ranges) <= 10
