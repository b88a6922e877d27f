"""Ground tracks with arcs: closed forms, the inverse, and an approach along one under the monitor."""

import dataclasses
import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from fti.config import Approach
from fti.errors import ConfigError
from fti.messages.outputs import ClearanceIntegrity, IntegrityState
from fti.messages.reasons import Reason
from fti.nav.integrity.approach import Airfield, ApproachPath, load_airfield
from fti.nav.integrity.approach_channel import ApproachChannel
from fti.nav.integrity.ground_track import GroundTrack, TrackLeg
from fti.nav.integrity.monitor import ClearanceSample
from fti.nav.integrity.reference import ApproachReference
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import AttitudeState, PositionState
from tests.nav.test_approach import TEXT
from tests.nav.test_approach_channel import height_of

Flight = Callable[..., Iterator[ClearanceSample]]
BANK = 20.0
#: 1 km of final, a quarter of a turn flown to the left with 600 m of radius, half a kilometre, and 30 deg to the right.
LEGS = (
    TrackLeg(length_m=1000.0),
    TrackLeg(length_m=600.0 * math.pi / 2, radius_m=-600.0, bank_deg=BANK),
    TrackLeg(length_m=500.0),
    TrackLeg(length_m=2000.0 * math.pi / 6, radius_m=2000.0, bank_deg=10.0),
)


@pytest.fixture
def curved(airfield: Airfield) -> Airfield:
    return airfield.model_copy(update={"leg": LEGS})


@pytest.fixture
def path(curved: Airfield) -> ApproachPath:
    return ApproachPath(curved)


def test_a_quarter_turn_to_the_left_onto_final_comes_from_the_left_of_it() -> None:
    """600 m farther back and to the left, at right angles to the final."""
    a, b = GroundTrack(LEGS).to_plane(np.array([1000.0 + 300.0 * math.pi, 1500.0 + 300.0 * math.pi]), np.zeros(2))
    np.testing.assert_allclose(a, [1600.0, 1600.0], atol=1e-6)
    np.testing.assert_allclose(b, [-600.0, -1100.0], atol=1e-6)


def test_the_course_is_that_of_the_way_flown(path: ApproachPath) -> None:
    s = np.linspace(-100.0, 5000.0, 400)
    before, behind = (np.stack(path.to_geodetic(s + ds, 0.0)) for ds in (1.0, -1.0))
    north, east = behind[0] - before[0], (behind[1] - before[1]) * np.cos(before[0])
    off = np.angle(np.exp(1j * (np.arctan2(east, north) - path.course(s))))
    assert np.max(np.abs(off)) < math.radians(0.5)  # meridian and normal radius differ
    np.testing.assert_allclose(np.degrees(path.course(0.0)), 250.0)


def test_geodetic_is_the_inverse_of_along_on_arcs_too(path: ApproachPath) -> None:
    s, y = np.meshgrid(np.linspace(-150.0, 6000.0, 200), [-140.0, 0.0, 140.0])
    found_s, found_y = path.to_path(*path.to_geodetic(s, y))
    np.testing.assert_allclose(found_s, s, atol=2e-3)
    np.testing.assert_allclose(found_y, y, atol=2e-3)


def test_one_place_is_along_as_many_are(path: ApproachPath) -> None:
    lat, lon = path.to_geodetic(1500.0, 20.0)
    assert path.to_path_one(float(lat), float(lon)) == pytest.approx((1500.0, 20.0), abs=1e-3)
    assert all(map(math.isnan, path.to_path_one(math.nan, 0.2)))


def test_bank_is_rolled_in_and_out(path: ApproachPath) -> None:
    middle = 1000.0 + 300.0 * math.pi / 2
    found = np.degrees(path.bank([500.0, 1000.0, middle, 2200.0, 2442.5 + 500.0]))
    np.testing.assert_allclose(found, [0.0, -BANK / 2, -BANK, 0.0, 10.0], atol=0.1)
    assert path.bank_one(middle) == pytest.approx(-math.radians(BANK), abs=1e-3)


def test_a_straight_leg_is_as_none(airfield: Airfield) -> None:
    with_leg = ApproachPath(airfield.model_copy(update={"leg": (TrackLeg(length_m=3000.0),)}))
    place = with_leg.to_geodetic(2500.0, 30.0)
    np.testing.assert_allclose(place, ApproachPath(airfield).to_geodetic(2500.0, 30.0), atol=1e-14)
    assert with_leg.bank_one(2500.0) == ApproachPath(airfield).bank_one(2500.0) == 0.0


def flight_course(path: ApproachPath, flight: Flight, level: bool) -> Iterator[tuple[ClearanceSample, NavState]]:
    """An approach from 2900 m, as navigation tells it; level : flown without bank."""
    for x in flight(begin=2900.0, end=200.0):
        lat, lon = map(float, path.to_geodetic(x.s, 5.0))
        place = PositionState(lat, lon, x.alt, 1.0, 1.0, 0.0, 0.0, 3.0, x.t_ns)
        roll = 0.0 if level else path.bank_one(x.s) + math.radians(2.0)
        yield x, NavState(x.t_ns, AttitudeState(roll, x.pitch, None, None, None), place, "ins", "ins", "ins")


@pytest.fixture
def channel(reference: ApproachReference, curved: Airfield) -> ApproachChannel:
    header = reference.header.model_copy(update={"airfield": curved})
    return ApproachChannel(dataclasses.replace(reference, header=header), Approach(profile="", alert_v_m=12.0), "radar")


def integrity(channel: ApproachChannel, inputs: Iterator[tuple[ClearanceSample, NavState]]) -> list[ClearanceIntegrity]:
    return [o for x, nav in inputs for o in channel.feed(height_of(x), nav) if isinstance(o, ClearanceIntegrity)]


def test_an_approach_along_the_arc_is_vouched_for(channel: ApproachChannel, path: ApproachPath, flight: Flight) -> None:
    outputs = integrity(channel, flight_course(path, flight, level=False))
    results = [o for o in outputs if o.t_ns > outputs[0].t_ns and (o.s_end is None or o.s_end < 2490.0)]
    assert {o.state for o in results} <= {IntegrityState.OK, IntegrityState.MONITOR}
    assert (results[0].s_end or 0.0) - (results[-1].s_end or 0.0) > 2200.0


def test_who_does_not_bank_with_the_track_is_refused(
    channel: ApproachChannel, path: ApproachPath, flight: Flight
) -> None:
    outputs = integrity(channel, flight_course(path, flight, level=True))
    assert any(o.reasons == (Reason.ROLL,) for o in outputs)


def test_legs_stand_in_the_reference(channel: ApproachChannel, reference: ApproachReference, curved: Airfield) -> None:
    bent = dataclasses.replace(reference, header=reference.header.model_copy(update={"airfield": curved}))
    again = ApproachReference.parse(bent.to_text(), "r.csv")
    assert again.header.airfield.leg == LEGS
    assert again.hash == bent.hash != reference.hash


@pytest.mark.parametrize(
    ("leg", "message"),
    [
        ("length_m = 500.0\nradius_m = 2000.0", "radius_m and bank_deg"),
        ("length_m = 500.0\nbank_deg = 10.0", "radius_m and bank_deg"),
        ("length_m = 500.0\nradius_m = 50.0\nbank_deg = 10.0", "at least 300 m"),
        ("length_m = 5000.0\nradius_m = -1000.0\nbank_deg = 10.0", "at most 180 deg"),
        ("length_m = -1.0", "length_m"),
    ],
)
def test_mistakes_in_a_leg_are_named(leg: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        load_airfield(f"{TEXT}\n[[leg]]\n{leg}\n", "field.toml")
    assert str(caught.value).startswith("field.toml: leg")
