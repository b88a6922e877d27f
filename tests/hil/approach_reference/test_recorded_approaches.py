"""References from recorded approaches: ways down the track, profiles, limits."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from fti.arrays import Array
from fti.errors import ConfigError, MissingError
from fti.hil.approach_reference.approaches import LASER, RA4500, SimulatedApproach, run_monitor, simulate
from fti.hil.approach_reference.calibration import make_monitor
from fti.hil.approach_reference.options import ReferenceOptions
from fti.hil.approach_reference.profile import Surface
from fti.hil.approach_reference.recorded_approaches import (
    Pass,
    RecordedGround,
    check_sensor,
    profiles_of,
    read_passes,
    reference_from_recordings,
    split_passes,
)
from fti.messages.outputs import IntegrityState
from fti.nav.integrity.approach import ApproachPath, load_airfield
from fti.nav.integrity.reference import ApproachReference, grid
from fti.terrain.demo_scene import DEMO_AIRFIELD

S_MAX = 2000.0
SCATTER_M = 0.8


@pytest.fixture(scope="module")
def path() -> ApproachPath:
    return ApproachPath(load_airfield(DEMO_AIRFIELD.read_text(), str(DEMO_AIRFIELD)))


@pytest.fixture(scope="module")
def ground(path: ApproachPath) -> RecordedGround:
    """Hills in closed form, and a scatter of 0.8 m over 30 m."""
    s = grid(5.0, S_MAX)
    z = 340.0 + 6.0 * np.sin(s / 37.0) + 8.0 * np.sin(s / 90.0)
    return RecordedGround(path, RA4500, Surface(s, z, np.full_like(s, SCATTER_M), np.full_like(s, 0.5)), 30.0)


@pytest.fixture(scope="module")
def flights(ground: RecordedGround) -> list[SimulatedApproach]:
    return [simulate(ground, S_MAX, np.random.default_rng([8, run])) for run in range(8)]


def as_pass(flight: SimulatedApproach) -> Pass:
    return Pass(np.rint(flight.t * 1e9).astype(np.int64), flight.nav_s, flight.nav_alt - flight.agl)


@pytest.fixture(scope="module")
def reference(path: ApproachPath, flights: list[SimulatedApproach]) -> ApproachReference:
    profiles = profiles_of([as_pass(flight) for flight in flights], S_MAX)
    plan = ReferenceOptions("radar", "2024-05-01", made_from="recordings", s_max=S_MAX, draws=len(profiles), runs=60)
    return reference_from_recordings(path, RA4500, profiles, plan, lambda *step: None)


def test_the_profile_is_the_ground(reference: ApproachReference, ground: RecordedGround) -> None:
    """Eight approaches that err by 1.5 m in height each: their mean within 2 m everywhere, 1.2 m RMS."""
    inside = (reference.s > 0.0) & (reference.s < S_MAX)
    error = (reference.z_ref - ground.surface.z_ref)[inside]
    assert np.abs(error).max() < 3.0
    assert np.sqrt(np.mean(error**2)) < 1.2
    header = reference.header
    assert (header.profile.made_from, header.profile.draws, header.detection) == ("recordings", 8, None)


def test_other_flights_over_the_same_ground_are_nominal(reference: ApproachReference, ground: RecordedGround) -> None:
    alarms = 0
    for run in range(10):
        outputs = run_monitor(make_monitor(reference), simulate(ground, S_MAX, np.random.default_rng([9, run])))
        alarms += any(o.state is IntegrityState.ALERT for o in outputs)
    assert alarms <= 1  # 1 % each: two or more have p = 0.004
    assert ApproachReference.parse(reference.to_text(), "r.csv").header == reference.header


def test_the_scatter_that_was_recorded_is_flown(ground: RecordedGround) -> None:
    s = np.arange(S_MAX, 0.0, -5.0)
    pose = np.zeros((6, len(s)))
    pose[0], pose[2] = s, 500.0
    drawn = np.array([500.0 - ground.ranges(pose, np.random.default_rng(k)) for k in range(60)])
    scatter = drawn - np.interp(s, ground.surface.s, ground.surface.z_ref)
    assert scatter.std() == pytest.approx(SCATTER_M, rel=0.1)
    neighbours = np.mean(scatter[:, 6:] * scatter[:, :-6]) / scatter.var()
    assert 0.2 < neighbours < 0.65  # exp(-1) at 30 m, drawn every 10 m


def test_fewer_than_five_are_no_reference(flights: list[SimulatedApproach]) -> None:
    passes = [as_pass(flight) for flight in flights[:5]]
    late = passes[0].s < S_MAX - 50.0
    passes[0] = Pass(passes[0].t_ns[late], passes[0].s[late], passes[0].z[late])
    assert len(profiles_of([*passes, as_pass(flights[5])], S_MAX)) == 5
    with pytest.raises(ConfigError, match=r"4 of 5 recorded passes start 2000 m .* a reference needs 5"):
        profiles_of(passes, S_MAX)


# ------------------------------------------------------------------------------------------------- aborted at 250 m

BREAK_OFF_M = 250.0
#: What each approach errs in height, all along [m]; the last two by much.
OFFSETS_M = (0.5, -0.5, 1.0, -1.0, 5.0, -5.0)
#: sqrt((n - 1) / chi2_0.05(n - 1)), from the table of chi-square: 0.3518 for 3, 0.7107 for 4, 1.1455 for 5 degrees.
FACTORS = {4: 2.920, 5: 2.372, 6: 2.089}


def wave(s: Array) -> Array:
    return np.asarray(340.0 + 4.0 * np.sin(s / 60.0))


def way_down(offset_m: float, until_m: float, begin_m: float = 2150.0) -> Pass:
    """A height every 3 m, exact but for the offset; aborted at so many metres before the intercept point."""
    s = np.arange(begin_m, until_m, -3.0)
    return Pass(np.arange(len(s), dtype=np.int64), s, wave(s) + offset_m)


def recorded_reference(path: ApproachPath, passes: list[Pass]) -> ApproachReference:
    profiles = profiles_of(passes, S_MAX)
    plan = ReferenceOptions("radar", "2024-05-01", made_from="recordings", s_max=S_MAX, draws=len(profiles), runs=20)
    return reference_from_recordings(path, RA4500, profiles, plan, lambda *step: None)


@pytest.mark.parametrize("broken_off", [1, 2])
def test_an_approach_that_was_broken_off_counts_as_far_as_it_went(path: ApproachPath, broken_off: int) -> None:
    """The sigma of each place is that of the approaches which were there, with the factor of their number.

    Heights err by the offsets alone, so the mean is the wave, and stays it where the approaches with the largest
    offsets break off: 5 m high would be a step of 1.2 m in the reference.
    """
    ends = [-200.0] * (6 - broken_off) + [BREAK_OFF_M] * broken_off
    passes = [way_down(offset, end) for offset, end in zip(OFFSETS_M, ends, strict=True)]
    reference = recorded_reference(path, passes)
    assert reference.header.profile.draws == 6
    inside = (reference.s >= 0.0) & (reference.s <= S_MAX)
    assert np.abs(reference.z_ref - wave(reference.s))[inside].max() < 0.2
    there = reference.s >= BREAK_OFF_M + 10.0
    after_abort = (reference.s >= 0.0) & (reference.s <= BREAK_OFF_M - 10.0)
    left = 6 - broken_off
    for where, offsets in ((inside & there, OFFSETS_M), (after_abort, OFFSETS_M[:left])):
        n = len(offsets)
        sigma = np.sqrt(np.sum(np.square(offsets)) / (n - 1)) * FACTORS[n]
        assert reference.s_ref[where] == pytest.approx(np.full(where.sum(), sigma), rel=0.05)


def test_five_of_which_one_is_broken_off_are_enough(path: ApproachPath) -> None:
    passes = [way_down(offset, -200.0) for offset in OFFSETS_M[:4]]
    assert recorded_reference(path, [*passes, way_down(0.0, BREAK_OFF_M)]).header.profile.draws == 5


def test_a_gap_takes_away_its_own_places_alone(path: ApproachPath) -> None:
    passes = [way_down(offset, -200.0) for offset in OFFSETS_M[:5]]
    neighbours = (passes[0].s > 900.0) | (passes[0].s < 850.0)
    passes[0] = Pass(passes[0].t_ns[neighbours], passes[0].s[neighbours], passes[0].z[neighbours])
    missing = np.isnan(profiles_of(passes, S_MAX)[0])
    assert 30.0 < 5.0 * missing.sum() <= 50.0
    assert np.isfinite(recorded_reference(path, passes).s_ref).all()


def test_places_with_too_few_approaches_are_reported() -> None:
    passes = [way_down(0.0, -200.0)] * 2 + [way_down(0.0, BREAK_OFF_M)] * 4
    with pytest.raises(ConfigError) as error:
        profiles_of(passes, S_MAX)
    assert str(error.value) == (
        "only 2 of 6 recorded approaches have a height at 0 to 245 m before the intercept point; "
        "a reference needs 3 everywhere"
    )


def test_a_way_that_is_shorter_than_a_window_is_no_approach() -> None:
    passes = [way_down(0.0, -200.0)] * 4 + [way_down(0.0, S_MAX - 300.0)]
    with pytest.raises(ConfigError, match=r"4 of 5 recorded passes .* for 400 m or more"):
        profiles_of(passes, S_MAX)


@pytest.mark.parametrize(("far", "message"), [(1300.0, "allowed: --s-max 1300 or less"), (800.0, None)])
def test_a_shorter_profile_is_proposed_where_one_can_be_made(
    flights: list[SimulatedApproach], far: float, message: str | None
) -> None:
    """``--s-max`` takes 1000 m and more."""
    passes = [as_pass(flight) for flight in flights[:5]]
    near = [Pass(one.t_ns[one.s <= far], one.s[one.s <= far], one.z[one.s <= far]) for one in passes]
    with pytest.raises(ConfigError, match="a reference needs 5") as error:
        profiles_of(near, S_MAX)
    assert (message in str(error.value)) if message else str(error.value).endswith("needs 5")


def test_a_flight_with_two_approaches_and_a_circuit_is_two_ways_down() -> None:
    out = np.arange(0.0, 2500.0, 3.0)
    s = np.concatenate((out[::-1], out, out[::-1]))
    passes = list(split_passes(Pass(np.arange(len(s)), s, np.zeros(len(s))), S_MAX))
    long = [one for one in passes if len(one.s) > 100]
    assert len(long) == 2
    assert all(np.all(np.diff(one.s) <= 20.0) for one in long)


@dataclass
class FakeRecording:
    """Outputs as a session has them."""

    outputs: list[tuple[str, dict[str, object]]] = field(default_factory=list)
    config: str = ""

    def attachments(self) -> dict[str, bytes]:
        return {"config.toml": self.config.encode()}

    def messages(self, prefix: str) -> list[tuple[str, int, int, int, bytes]]:
        return [(topic, 0, 0, 0, json.dumps(data).encode()) for topic, data in self.outputs if topic.startswith(prefix)]


def test_sessions_are_read_at_the_times_of_the_heights(
    path: ApproachPath, flights: list[SimulatedApproach], monkeypatch: pytest.MonkeyPatch
) -> None:
    flight, outputs = flights[0], list[tuple[str, dict[str, object]]]()
    lat, lon = path.to_geodetic(flight.nav_s, flight.nav_y)
    for k in range(0, len(flight.t), 5):
        place = {"lat": lat[k], "lon": lon[k], "alt": flight.nav_alt[k], "roll": 0.01, "pitch": 0.02}
        outputs.append(("/nav/nav_solution", {"t_valid_ns": 10**18 + int(flight.t[k] * 1e9), "valid": True, **place}))
    for k in range(len(flight.t)):
        stamp = {"t_valid_ns": 10**18 + int(flight.t[k] * 1e9), "height_agl": flight.agl[k]}
        # one in 50 is refused; the known ground speaks against others, which the monitor takes all the same
        reasons = ["device_flag"] if k % 50 == 0 else ["deviation"] * (k % 10 == 0)
        outputs.append(("/nav/height_above_ground/radar", {**stamp, "valid": not reasons, "reasons": reasons}))
    fake = FakeRecording(outputs)
    open_fake: Callable[[Path], FakeRecording] = lambda folder: fake  # noqa: E731
    monkeypatch.setattr("fti.hil.approach_reference.recorded_approaches.Recording.open", open_fake)
    (found,) = read_passes(Path("x"), "radar", path, S_MAX)
    assert len(found.s) == pytest.approx(len(flight.t) * 0.98, abs=6)
    wanted = np.interp(found.s[::-1], flight.nav_s[::-1], (flight.nav_alt - flight.agl)[::-1])[::-1]
    assert np.median(np.abs(found.z - wanted)) < 0.2
    rest = [
        ({**message, "altitude_source": "filter"} if "solution" in topic else message) for topic, message in outputs
    ]
    fake.outputs = [(topic, message) for (topic, _), message in zip(outputs, rest, strict=True)]
    with pytest.raises(MissingError, match="no heights of 'radar' with a position"):
        read_passes(Path("x"), "radar", path, S_MAX)
    with pytest.raises(MissingError, match="no heights of 'laser'"):
        read_passes(Path("x"), "laser", path, S_MAX)


CONFIG = """
[session]
name = "t"
[[link]]
name = "line"
kind = "serial"
port = "/dev/null"
[[device]]
name = "radar"
link = "line"
driver = "lightware_ascii"
altimeter = { kind = "radar", range_m = [1.0, 700.0], beam_deg = 40.0 }
"""


def test_a_reference_of_one_altimeter_is_not_made_of_the_heights_of_another(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = FakeRecording(config=CONFIG)
    open_fake: Callable[[Path], FakeRecording] = lambda folder: fake  # noqa: E731
    monkeypatch.setattr("fti.hil.approach_reference.recorded_approaches.Recording.open", open_fake)
    check_sensor(Path("x"), "radar", RA4500)
    with pytest.raises(ConfigError, match=r"x: 'radar' is a radar of 40 deg; .* laser"):
        check_sensor(Path("x"), "radar", LASER)
    with pytest.raises(ConfigError, match="x: has no altimeter 'laser'"):
        check_sensor(Path("x"), "laser", LASER)
    fake.config = CONFIG.replace("40.0", "25.0")
    with pytest.raises(ConfigError, match="radar of 25 deg"):
        check_sensor(Path("x"), "radar", RA4500)
