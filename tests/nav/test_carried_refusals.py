"""Refusals at the start of navigation: each ends by the same conditions as before the restart, or later."""

from __future__ import annotations

import numpy as np
import pytest

from fti.messages.measurements import Attitude, Measurement, Position, Stamp, Velocity
from fti.messages.outputs import Event, FilterMode, NavSolution, Output
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal, RefusedPart
from fti.nav.pipeline import Pipeline
from fti.nav.plausibility.finding import PlausibilityFinding
from fti.nav.protection import FilterReference
from fti.nav.source_check import SourceCheck
from fti.nav.source_interpolation import PositionState
from tests.nav.healthy_receivers import fly as fly_truth
from tests.nav.healthy_receivers import measure
from tests.nav.plausibility.receiver_runs import T0, UBX1, Result, S, make_tests, run
from tests.nav.receiver_flights import SECONDS, config, draw, fly

RADIUS = 6_366_000.0


def excluded(device: str, part: RefusedPart) -> CarriedRefusal:
    return CarriedRefusal(device, part, Reason.EXCLUDED, T0, is_standing=True)


def receiver(refusal: PlausibilityFinding, readmit_s: float | None = None, there_and_back: bool = False) -> Result:
    """Of four minutes of a sound receiver that was refused; 50 m north from 60 to 80 s where asked for."""

    def change(t: float, m: Measurement) -> Measurement | None:
        if there_and_back and 60.0 <= t < 80.0 and isinstance(m, Position) and m.lat is not None:
            return Position(**{**{n: getattr(m, n) for n in m.__struct_fields__}, "lat": m.lat + 50.0 / RADIUS})
        return m

    tests = make_tests()
    tests.position.restore(refusal)
    rng = np.random.default_rng(3)
    return run(measure(rng, fly_truth(rng, 240, 1.5), UBX1, T0), change, tests, readmit_s)


STANDING = PlausibilityFinding(Reason.JUMP, T0 - 5 * S, "before", is_standing=True)


def test_a_refusal_that_does_not_stand_ends_after_30_s() -> None:
    result = receiver(PlausibilityFinding(Reason.REPEATED, T0 - 5 * S, "before"))
    assert not result.is_valid_at(28.0)
    assert result.is_valid_at(33.0)


def test_a_contradiction_that_stood_is_ended_by_the_operator_alone() -> None:
    assert not any(valid for _, valid, _ in receiver(STANDING).valid)
    result = receiver(STANDING, readmit_s=100.0)
    assert not result.is_valid_at(99.0)
    assert result.is_valid_at(102.0), "time in which the tests have passed before counts"


def test_a_step_there_and_back_does_not_end_what_stood_before() -> None:
    """It cancels itself: nothing is known of the contradiction of before."""
    result = receiver(STANDING, there_and_back=True)
    assert not any(valid for _, valid, _ in result.valid)


@pytest.fixture
def until_s(scale: int) -> float:
    """End of the flights [s]."""
    return 180.0 if scale == 1 else SECONDS


def test_the_filter_does_not_begin_with_a_receiver_that_the_one_before_excluded(until_s: float) -> None:
    flight = fly(draw(0), restored=[excluded("gnss", RefusedPart.AIDING)], until_s=until_s)
    assert flight.t == []
    assert "gnss: still refused after navigation was started again" in flight.texts()


def test_beside_another_receiver_it_stays_excluded(until_s: float) -> None:
    flight = fly(draw(0, ("gnss", "second")), restored=[excluded("gnss", RefusedPart.AIDING)], until_s=until_s)
    assert len(flight.refused_at("gnss")) == len(flight.t) > until_s - 30.0
    assert flight.mode[-1] is FilterMode.AIDED
    assert flight.misled(60.0) == 0.0


def test_a_height_alone_stays_excluded(until_s: float) -> None:
    """A second receiver gives the height; the position of the first one aids."""
    flight = fly(draw(0, ("gnss", "second")), restored=[excluded("gnss", RefusedPart.AIDING_HEIGHT)], until_s=until_s)
    assert len(flight.refused_at("gnss")) == 0
    assert flight.mode[-1] is FilterMode.AIDED
    assert "gnss height: still refused" in flight.texts()
    assert "gnss height: aids the filter again" not in flight.texts()


def test_the_altitude_of_a_receiver_whose_height_is_excluded_is_not_used() -> None:
    """Without a filter it was valid: 47 m off with a level of 12 m."""
    pipeline, out = Pipeline(config(("gnss",), baro=True), None), list[Output | Event]()
    pipeline.restore([excluded("gnss", RefusedPart.AIDING_HEIGHT)], T0)
    for k in range(250):
        t_ns = T0 + k * S // 50
        stamp, north = Stamp(t_ns), 60.0 * k / 50.0
        if k % 10 == 0:
            pipeline.feed("gnss", Velocity(stamp=stamp, north=60.0, east=0.0, down=0.0, sd=0.1))
            place = Position(stamp=stamp, lat=0.8 + north / RADIUS, lon=0.1, alt=547.0, horizontal_sd=2.0)
            pipeline.feed("gnss", place)
        pipeline.feed("imu", Attitude(stamp=stamp, roll=0.0, pitch=0.0, heading=0.0))
        out += pipeline.tick(t_ns)
    solutions = [o for o in out if isinstance(o, NavSolution) and o.position_source == "gnss"]
    assert len(solutions) > 100
    assert {(o.valid, o.alt, o.vpl) for o in solutions} == {(False, None, None)}
    assert all(Reason.NO_ALTITUDE in o.reasons for o in solutions)


def test_refusals_of_other_devices_are_left_out(until_s: float) -> None:
    flight = fly(draw(0), restored=[excluded("other", RefusedPart.AIDING)], until_s=until_s)
    assert flight.mode[-1] is FilterMode.AIDED
    assert not flight.events


@pytest.mark.parametrize(("level_m", "is_refused"), [(40.0, False), (60.0, True)])
def test_a_device_that_differed_is_used_again_where_the_filter_would_see_it(level_m: float, is_refused: bool) -> None:
    """100 m of difference before: it agrees with a filter that knows it to 40 m, or to 60 m."""
    check = SourceCheck({"box": (3.0, 3.0)})
    (event,) = check.restore([CarriedRefusal("box", RefusedPart.DIFFERENCE, Reason.CONTRADICTION, 0, size_m=100.0)], T0)
    assert event.text.startswith("box: still refused")
    here = PositionState(0.8, 0.2, 100.0, 1.0, 1.0, None, None, None, T0)
    for second in range(31):
        assert check.refused == {"box"}
        check.update(T0 + second * S, {"box": here}, FilterReference(here, level_m, 20.0))
    assert (check.refused == {"box"}) is is_refused
