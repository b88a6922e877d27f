"""What a reference assumes: in the file, in the weights, and compared with the flight."""

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any, Literal

import numpy as np
import pytest
from msgspec import structs

from fti.config import Altimeter, Approach, Device, UnstatedSd
from fti.errors import ConfigError
from fti.messages.outputs import ClearanceIntegrity, Event, IntegrityState
from fti.messages.reasons import Reason
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.approach_channel import ApproachChannel
from fti.nav.integrity.assumptions import Assumptions, receiver_holds
from fti.nav.integrity.monitor import ClearanceMonitor, ClearanceSample
from fti.nav.integrity.reference import ApproachReference, check_alert_limit, min_level_v
from fti.nav.integrity.statistics import Matcher
from fti.nav.integrity.window import Bins
from tests.nav.test_approach_channel import inputs

Flight = Callable[..., Iterator[ClearanceSample]]

ASSUMED = Assumptions(
    nav_vertical_sd_m=3.0,
    nav_horizontal_sd_m=5.0,
    nav_noise_sd_m=1.5,
    track_sd_m=15.0,
    height_sd_m=5.0,
    elevation_short_sd_m=2.0,
    elevation_long_sd_m=2.0,
    receiver="drawn",
    beam_deg=40.0,
    receivers=60,
)
SETTINGS = Approach(profile="x.csv", alert_v_m=60.0)


@pytest.fixture
def stated(reference: ApproachReference) -> ApproachReference:
    """The reference with assumptions."""
    return dataclasses.replace(reference, header=reference.header.model_copy(update={"assumptions": ASSUMED}))


def states(monitor: ClearanceMonitor, flight: Iterator[ClearanceSample]) -> list[ClearanceIntegrity]:
    outputs = [output for x in flight if (output := monitor.step(x))]
    return [output for output in outputs if output.t1_ratio is not None]


def test_assumptions_are_in_the_file_and_an_older_file_has_none(
    reference: ApproachReference, stated: ApproachReference
) -> None:
    text = stated.to_text()
    assert "# assumptions.nav_vertical_sd_m = 3.0" in text
    assert ApproachReference.parse(text, "r.csv").header.assumptions == ASSUMED
    assert ApproachReference.parse(reference.to_text(), "r.csv").header.assumptions is None


def test_noise_of_navigation_lowers_the_weights(reference: ApproachReference, stated: ApproachReference) -> None:
    """Uniform sigmas of 1.2 m and 0.9 m, so 1.5 m in all, and 1.5 m of noise: T1 is half of what it was."""
    uniform: dict[str, Any] = {"s_ref": np.full_like(reference.s, 1.2), "s_alt": np.full_like(reference.s, 0.9)}
    n = round(reference.header.profile.window_m / reference.header.profile.ds_m) + 1
    z = reference.z_ref[200 : 200 + n] + 3.0 * np.sin(np.arange(n))
    bins = Bins(200, np.ones(n, dtype=bool), z, np.zeros(n))
    without, with_noise = (
        Matcher(dataclasses.replace(one, **uniform), 50.0).evaluate(bins, 3.0) for one in (reference, stated)
    )
    assert with_noise.t1 == pytest.approx(without.t1 / 2.0, rel=1e-9)
    assert with_noise.t4 == pytest.approx(without.t4 / math.sqrt(2.0), rel=1e-9)


@pytest.mark.parametrize(
    ("vertical", "horizontal", "holds"),
    [(3.0, 5.0, True), (3.7, 6.2, True), (3.8, 5.0, False), (3.0, 6.3, False), (None, 5.0, False), (3.0, None, False)],
)
def test_a_worse_navigation_is_unavailable(
    stated: ApproachReference, flight: Flight, vertical: float | None, horizontal: float | None, holds: bool
) -> None:
    """A quarter beyond the assumed sigma is tolerated; a sigma that nobody knows is not."""
    track = (
        structs.replace(x, vertical_sd=vertical, horizontal_sd=horizontal) for x in flight(begin=2900.0, end=1000.0)
    )
    for output in states(ClearanceMonitor(stated, SETTINGS), track):
        assert (Reason.ASSUMPTION in output.reasons) is not holds
        assert output.valid is holds
        assert (output.state is IntegrityState.UNAVAILABLE) is not holds


def test_without_assumptions_nothing_is_compared(reference: ApproachReference, flight: Flight) -> None:
    track = (structs.replace(x, vertical_sd=8.0, horizontal_sd=20.0) for x in flight(begin=2900.0, end=1000.0))
    outputs = states(ClearanceMonitor(reference, Approach(profile="", alert_v_m=1000.0)), track)
    assert outputs
    assert not any(Reason.ASSUMPTION in output.reasons for output in outputs)


def test_an_alert_is_given_beyond_the_assumptions_all_the_same(stated: ApproachReference, flight: Flight) -> None:
    track = (
        structs.replace(x, vertical_sd=8.0, horizontal_sd=5.0, agl=x.agl - (100.0 if 1500.0 < x.s < 1600.0 else 0.0))
        for x in flight(begin=2900.0, end=1000.0)
    )
    assert any(o.state is IntegrityState.ALERT for o in states(ClearanceMonitor(stated, SETTINGS), track))


def altimeter(beam_deg: float = 40.0, model: Literal["nearest", "beam"] = "nearest") -> Device:
    return Device(
        name="radar",
        link="line",
        driver="freeflight_ra4500",
        altimeter=Altimeter(kind="radar", range_m=(0.0, 700.0), beam_deg=beam_deg, model=model),
    )


def test_another_beam_or_receiver_is_not_the_assumed_one() -> None:
    assert receiver_holds(ASSUMED, altimeter())
    assert receiver_holds(ASSUMED, altimeter(model="beam"))
    assert not receiver_holds(ASSUMED, altimeter(beam_deg=55.0))
    assert not receiver_holds(ASSUMED.model_copy(update={"receiver": "nearest"}), altimeter(model="beam"))
    assert receiver_holds(None, altimeter(beam_deg=55.0))


def test_an_alert_limit_below_the_least_protection_level_is_refused(reference: ApproachReference) -> None:
    """Sigmas so small that the datum alone counts: (4 + 3.09) x 1 m."""
    sharp = dataclasses.replace(reference, s_ref=np.full_like(reference.s, 1e-3), s_alt=np.full_like(reference.s, 1e-3))
    assert min_level_v(sharp) == pytest.approx(7.09, abs=0.01)
    check_alert_limit(sharp, 7.1, "x.csv", "c.toml")
    with pytest.raises(ConfigError) as refusal:
        check_alert_limit(sharp, 5.0, "x.csv", "c.toml")
    assert str(refusal.value) == (
        "c.toml: nav.approach.alert_v_m: 5 m is below the minimum protection level 7.1 m of x.csv; must be at least 8 m"
    )


def test_a_source_without_a_sigma_has_the_configured_one_and_an_event(
    stated: ApproachReference, path: ApproachPath, flight: Flight
) -> None:
    samples = [
        (height, structs.replace(nav, position=structs.replace(nav.position, vertical_sd=None)))
        for height, nav in inputs(path, flight, lambda _: "ins")
        if nav.position
    ]
    outputs_by_sd: dict[float, list[object]] = {}
    for high in (3.0, 6.6):
        channel = ApproachChannel(stated, SETTINGS, "radar", unstated={"ins": (3.0, high)})
        outputs_by_sd[high] = [output for height, nav in samples for output in channel.feed(height, nav)]
        events = [output.text for output in outputs_by_sd[high] if isinstance(output, Event)]
        assert events == [f"states no sigma of its altitude; {high:g} m count for the approach (nav.unstated_sd)"]
    evaluated = {
        high: [o for o in out if isinstance(o, ClearanceIntegrity) and o.t1_ratio]
        for high, out in outputs_by_sd.items()
    }
    assert all(output.valid for output in evaluated[3.0])
    assert all(Reason.ASSUMPTION in output.reasons for output in evaluated[6.6])
    assert (
        min(o.height_error_sd or 0.0 for o in evaluated[6.6])
        > 6.6
        > max(o.height_error_sd or 0.0 for o in evaluated[3.0])
    )


def test_each_source_is_reported_with_the_sigma_of_its_own_axis(
    stated: ApproachReference, path: ApproachPath, flight: Flight
) -> None:
    """The place by one source, the altitude by another: neither states a sigma."""
    channel = ApproachChannel(stated, SETTINGS, "radar", unstated={"ins": (3.0, 10.0), "gnss": (2.0, 6.0)})
    outputs_by_sd = [
        output
        for height, nav in inputs(path, flight, lambda _: "gnss")
        if nav.position
        for output in channel.feed(
            height,
            structs.replace(nav, position=structs.replace(nav.position, horizontal_sd=None, vertical_sd=None)),
        )
    ]
    assert [(output.source, output.text) for output in outputs_by_sd if isinstance(output, Event)] == [
        ("ins", "states no sigma of its position; 3 m count for the approach (nav.unstated_sd)"),
        ("gnss", "states no sigma of its altitude; 6 m count for the approach (nav.unstated_sd)"),
    ]


def test_the_default_sigmas_are_those_of_the_service() -> None:
    assert UnstatedSd().satellites == pytest.approx((8.0 / 2.45, 13.0 / 1.96), rel=0.02)
