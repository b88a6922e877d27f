"""The channel of the approach: whose altitude it is judged with."""

import math
from collections.abc import Callable, Iterator

import pytest
from msgspec import structs

from fti.config import Approach
from fti.messages.outputs import ClearanceIntegrity, GlideSlope, HeightAboveGround, IntegrityState
from fti.messages.reasons import Reason
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.approach_channel import ApproachChannel
from fti.nav.integrity.monitor import ClearanceSample
from fti.nav.integrity.reference import ApproachReference
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import AttitudeState, PositionState

Flight = Callable[..., Iterator[ClearanceSample]]
Inputs = list[tuple[HeightAboveGround, NavState]]
EVALUATED = {IntegrityState.OK, IntegrityState.MONITOR}


def height_of(x: ClearanceSample) -> HeightAboveGround:
    """What the altimeter says there."""
    return HeightAboveGround(
        t_ns=x.t_ns,
        t_valid_ns=x.t_valid_ns,
        sensor="radar",
        raw=x.agl,
        height_agl=x.agl + 7.0,  # what is straight below is not what the monitor compares
        sd=0.5,
        nearest=x.agl,
        nearest_sd=0.5,
        valid=True,
        reasons=(),
    )


def inputs(path: ApproachPath, flight: Flight, altitude_source: Callable[[float], str]) -> Inputs:
    """A nominal approach; altitude_source : of the path length."""
    result: Inputs = []
    for x in flight(begin=2900.0, end=1000.0):
        lat, lon = (float(v) for v in path.to_geodetic(x.s, x.y))
        place = PositionState(lat, lon, x.alt, 1.0, 1.0, 0.0, 0.0, 3.0, x.t_ns)
        attitude = AttitudeState(x.roll, x.pitch, math.radians(path.airfield.course_deg), 1e-3, 1e-3)
        result.append((height_of(x), NavState(x.t_ns, attitude, place, "ins", "ins", altitude_source(x.s))))
    return result


def run(channel: ApproachChannel, samples: Inputs) -> tuple[list[ClearanceIntegrity], list[GlideSlope]]:
    out = [o for height, nav in samples for o in channel.feed(height, nav)]
    return [o for o in out if isinstance(o, ClearanceIntegrity)], [o for o in out if isinstance(o, GlideSlope)]


@pytest.fixture
def settings() -> Approach:
    return Approach(profile="", alert_v_m=12.0)


def test_an_altitude_that_the_altimeter_holds_itself_judges_nothing(
    reference: ApproachReference, settings: Approach, path: ApproachPath, flight: Flight
) -> None:
    """Altitude minus height would be the ground that is known, wherever the aircraft is: a test of nothing."""
    samples = inputs(path, flight, lambda s: "ins" if s > 1800.0 else "filter")
    integrity, slopes = run(ApproachChannel(reference, settings, "radar", frozenset({"filter"})), samples)
    before = [o for o in integrity if o.s_end is not None and 1810.0 < o.s_end < 2400.0]
    assert {o.state for o in before} <= EVALUATED
    assert (integrity[-1].state, integrity[-1].reasons) == (IntegrityState.UNAVAILABLE, (Reason.NOT_INDEPENDENT,))
    assert min(o.s_end for o in integrity if o.valid and o.s_end is not None) > 1780.0
    assert not slopes[-1].valid


def test_an_altimeter_that_the_filter_excludes_is_evaluated_as_before(
    reference: ApproachReference, settings: Approach, path: ApproachPath, flight: Flight
) -> None:
    """A wrong height is what the monitor is for: it alerts, and is not made silent by the filter."""
    samples = inputs(path, flight, lambda _: "ins")
    sound, _ = run(ApproachChannel(reference, settings, "radar"), samples)
    refused = [
        (
            structs.replace(height, valid=False, reasons=(Reason.EXCLUDED,), nearest=(height.nearest or 0.0) + 40.0),
            nav,
        )
        for height, nav in samples
    ]
    wrong, _ = run(ApproachChannel(reference, settings, "radar"), refused)
    assert {o.state for o in sound} & EVALUATED
    assert wrong[-1].state is IntegrityState.ALERT


def test_a_place_of_which_navigation_is_not_sure_is_reported(
    reference: ApproachReference, settings: Approach, path: ApproachPath, flight: Flight
) -> None:
    samples = [
        (height, structs.replace(nav, position=structs.replace(nav.position, horizontal_sd=200.0)))
        for height, nav in inputs(path, flight, lambda _: "filter")
        if nav.position
    ]
    integrity, slopes = run(ApproachChannel(reference, settings, "radar"), samples)
    assert Reason.POSITION_UNCERTAIN in integrity[-1].reasons
    assert not any(output.valid for output in integrity)
    assert not any(slope.valid for slope in slopes)


def test_a_place_that_is_certain_but_not_protected_is_reported(
    reference: ApproachReference, settings: Approach, path: ApproachPath, flight: Flight
) -> None:
    """A sigma of 1 m, and a source that may be wrong by more than alert_y_m, or by less."""
    samples = inputs(path, flight, lambda _: "ins")
    for hpl, is_uncertain in ((settings.alert_y_m + 1.0, True), (settings.alert_y_m - 1.0, False), (None, False)):
        channel = ApproachChannel(reference, settings, "radar")
        channel.set_protection_level(hpl)
        integrity, slopes = run(channel, samples)
        assert (Reason.POSITION_UNCERTAIN in integrity[-1].reasons) is is_uncertain
        assert any(output.valid for output in integrity) is not is_uncertain
        assert any(slope.valid for slope in slopes) is not is_uncertain


def test_another_source_of_the_altitude_alone_begins_a_new_window(
    reference: ApproachReference, settings: Approach, path: ApproachPath, flight: Flight
) -> None:
    samples = inputs(path, flight, lambda s: "ins" if s > 1800.0 else "vertical")
    integrity, _ = run(ApproachChannel(reference, settings, "radar"), samples)
    behind = [o.state for o in integrity if o.s_end is not None and o.s_end < 1795.0]
    assert behind[0] is IntegrityState.ACQUIRE
    assert behind[-1] in EVALUATED
