"""Protection levels of the attitude: against simulated errors, and through the pipeline."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm, rayleigh

from fti.config import AlertLimits, parse
from fti.messages.measurements import Attitude, Stamp
from fti.messages.outputs import FilterMode, FilterSolution, NavSolution
from fti.messages.reasons import Reason
from fti.nav.attitude_protection import AssumedSigmas, AttitudeLevels, AttitudeProtection, levels
from fti.nav.pipeline import Pipeline
from fti.nav.source_interpolation import AttitudeState, NavSource

S = 1_000_000_000
T0 = 1000 * S
DEG = math.radians(1.0)
ASSUMED, LIMIT = AssumedSigmas(1.0 * DEG, 2.0 * DEG), 2.0 * DEG
#: 1e-5 radially and on one axis.
RADIAL, AXIS = rayleigh.isf(1e-5), norm.isf(0.5e-5)


def state(
    roll: float = 0.0,
    pitch: float = 0.0,
    heading: float | None = 0.0,
    tilt_sd: float | None = None,
    heading_sd: float | None = None,
) -> AttitudeState:
    """In degrees."""
    tilt, turn = (None if sd is None else sd * DEG for sd in (tilt_sd, heading_sd))
    turned = None if heading is None else heading * DEG
    return AttitudeState(roll * DEG, pitch * DEG, turned, tilt, tilt, tilt, turn)


def test_beside_another_source_it_is_the_difference_and_the_level_of_the_other() -> None:
    """Whatever sigma it states: 3 deg of roll and 4 of pitch are 5 deg of tilt."""
    liar = state(3.0, -4.0, 359.0, tilt_sd=0.001, heading_sd=0.001)
    result = levels(liar, [state(heading=2.0, tilt_sd=0.1, heading_sd=1.0)], ASSUMED, LIMIT)
    assert result.tilt == pytest.approx((5.0 + 0.1 * RADIAL) * DEG, rel=1e-3)
    assert result.heading == pytest.approx((3.0 + 1.0 * AXIS) * DEG, rel=1e-3)
    assert result[2:] == ((), True)


def test_alone_it_has_the_level_of_its_own_sigma_or_of_the_assumed_one() -> None:
    stated = levels(state(tilt_sd=0.2, heading_sd=0.5), [], ASSUMED, LIMIT)
    assert stated[:2] == pytest.approx((0.2 * RADIAL * DEG, 0.5 * AXIS * DEG), rel=1e-3)
    assert stated[2:] == ((Reason.NOTHING_TO_COMPARE,), True)
    silent = levels(state(), [], ASSUMED, LIMIT)
    assert silent[:2] == pytest.approx((1.0 * RADIAL * DEG, 2.0 * AXIS * DEG), rel=1e-3)
    assert silent[2:] == ((Reason.NOTHING_TO_COMPARE,), False)
    assert levels(state(heading=None), [], ASSUMED, LIMIT).heading is None


def test_every_sharp_source_bounds_it_and_an_uncertain_one_does_not_widen_it() -> None:
    near, far = state(0.1, tilt_sd=0.02), state(0.5, tilt_sd=0.05)
    ahrs = state(1.5)
    result = levels(state(tilt_sd=0.02), [near, far, ahrs], ASSUMED, LIMIT)
    assert result.tilt == pytest.approx((0.5 + 0.05 * RADIAL) * DEG, rel=1e-3)


@pytest.mark.parametrize(("off", "is_checked"), [(0.5, False), (5.0, False), (6.5, True)])
def test_an_uncertain_source_makes_it_invalid_only_where_it_contradicts(off: float, is_checked: bool) -> None:
    """Beside an assumed sigma of 1 deg, a stated one of 0.02 deg: beyond 5.5 deg one of the two is wrong."""
    result = levels(state(tilt_sd=0.02), [state(off)], ASSUMED, LIMIT)
    assert result.tilt == pytest.approx((off + 1.0 * RADIAL) * DEG, rel=1e-3)
    assert result.unchecked == (Reason.UNCERTAIN,)
    assert bool(result.reasons(AlertLimits())) is is_checked


def test_a_source_that_fell_silent_in_a_roll_contradicts_nobody() -> None:
    """Held for 0.3 s at 20 deg/s it is 6 deg off; its sigma has grown by 3 deg."""
    attitude = AttitudeState(6.0 * DEG, 0.0, 0.0, 3.0 * DEG, 3.0 * DEG, 0.02 * DEG, 0.02 * DEG)
    result = levels(state(tilt_sd=0.02), [attitude], ASSUMED, LIMIT)
    assert result.reasons(AlertLimits()) == ()
    assert result.unchecked == (Reason.UNCERTAIN,)
    with_other = levels(state(tilt_sd=0.02), [attitude, state(tilt_sd=0.05)], ASSUMED, LIMIT)
    assert with_other.tilt == pytest.approx(0.05 * RADIAL * DEG, rel=1e-3)


def test_a_drawn_error_is_beyond_its_level_no_more_often_than_promised() -> None:
    """One source that is wrong by anything, beside one that errs as it states: never in 2000."""
    rng = np.random.default_rng(5)
    error, own = rng.normal(0.0, 0.15, (2000, 2)), rng.uniform(-6.0, 6.0, (2000, 2))
    beyond = 0
    for e, a in zip(error, own, strict=True):
        result = levels(state(a[0], a[1]), [state(e[0], e[1], tilt_sd=0.15)], ASSUMED, LIMIT)
        assert result.tilt is not None
        beyond += math.hypot(*a) * DEG > result.tilt
        excess = math.hypot(*a) + 0.15 * RADIAL + math.hypot(*e)  # never larger than needed by both errors
        assert result.tilt <= excess * DEG * 1.001
    assert beyond == 0


def test_reasons_follow_the_alert_limit_and_what_the_configuration_demands() -> None:
    limits, demand = AlertLimits(), AlertLimits(compared=True)
    assert AttitudeLevels(2.0 * DEG * 0.999, None, (), True).reasons(limits) == ()
    assert AttitudeLevels(2.0 * DEG * 1.001, None, (), True).reasons(limits) == (Reason.ATTITUDE_LEVEL,)
    assert AttitudeLevels(2.0 * DEG * 1.001, None, (), True).reasons(AlertLimits(attitude_deg=3.0)) == ()
    assert AttitudeLevels(5.0 * DEG, None, (Reason.NOTHING_TO_COMPARE,), False).reasons(limits) == ()
    alone = AttitudeLevels(0.1 * DEG, None, (Reason.NOTHING_TO_COMPARE,), True)
    assert alone.reasons(demand) == (Reason.NOTHING_TO_COMPARE,)
    assert AttitudeLevels(0.1 * DEG, None, (Reason.UNCERTAIN,), False).reasons(demand) == ()
    assert AttitudeLevels(None, None).reasons(limits) == (Reason.NO_ATTITUDE,)


# ------------------------------------------------------------------------------------------------- beside the filter


def config(sources: tuple[str, ...] = ("ins", "ahrs"), **nav: Any) -> Any:
    device = {"link": "l", "driver": "d"}
    table = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": name, **device} for name in sources],
        "nav": {"attitude": list(sources), **nav},
    }
    return parse(table, "", Path("t.toml"))


def filtered(t_ns: int, roll: float = 0.0, mode: FilterMode = FilterMode.AIDED, sd: float = 0.05) -> FilterSolution:
    """In degrees."""
    return FilterSolution(
        t_ns=t_ns, t_valid_ns=t_ns, valid=mode in {FilterMode.AIDED, FilterMode.COASTING}, reasons=(), mode=mode,
        roll=roll * DEG, pitch=0.0, heading=0.0, tilt_sd=sd * DEG, heading_sd=1.0 * DEG,
    )  # fmt: skip


class Bench:
    """One device at 50 Hz and the filter at 5 Hz.  roll(t), filter_roll(t) [deg], t [s]"""

    def __init__(self, sd: float | None = 0.02) -> None:
        of = config(("ins",))
        self.source = NavSource(of.device[0])
        self.protection = AttitudeProtection(of, {"ins": self.source})
        self.sd = None if sd is None else sd * DEG

    def run(self, begin: float, end: float, roll: Any, filter_roll: Any = None, **filter_levels: Any) -> AttitudeLevels:
        """Levels at the end."""
        result = AttitudeLevels(None, None)
        for k in range(round(begin * 50), round(end * 50)):
            t, t_ns = k / 50, T0 + k * S // 50
            angle, sd = roll(t) * DEG, self.sd
            m = Attitude(stamp=Stamp(t_ns), roll=angle, pitch=0.0, heading=0.0, roll_sd=sd, pitch_sd=sd, heading_sd=sd)
            self.source.push_attitude(m, t_ns)
            result = self.at(t_ns)
            if k % 10 == 0 and filter_roll is not None:
                self.protection.feed_filter(filtered(t_ns, filter_roll(t), **filter_levels))
        return result

    def at(self, t_ns: int) -> AttitudeLevels:
        return self.protection.at(t_ns, self.source.attitude(t_ns), "ins")


def test_the_filter_counts_when_satellites_have_aided_it_for_30_s_and_while_it_coasts_then() -> None:
    bench = Bench()
    assert bench.run(0.0, 29.0, lambda t: 0.0, lambda t: 0.0).unchecked == (Reason.NOTHING_TO_COMPARE,)
    result = bench.run(29.0, 31.0, lambda t: 0.0, lambda t: 0.0)
    assert result.tilt == pytest.approx(0.05 * RADIAL * DEG, rel=1e-3)
    assert result.unchecked == ()
    coasting = bench.run(31.0, 40.0, lambda t: 0.0, lambda t: 0.0, mode=FilterMode.COASTING, sd=0.1)
    assert coasting.tilt == pytest.approx(0.1 * RADIAL * DEG, rel=1e-3)
    anew = bench.run(40.0, 45.0, lambda t: 0.0, lambda t: 0.0, mode=FilterMode.ALIGNING)
    assert anew.unchecked == (Reason.NOTHING_TO_COMPARE,)
    assert bench.run(45.0, 60.0, lambda t: 0.0, lambda t: 0.0).unchecked == (Reason.NOTHING_TO_COMPARE,)


def test_a_step_of_the_device_is_in_the_level_within_half_a_second() -> None:
    bench = Bench()
    bench.run(0.0, 35.0, lambda t: 0.0, lambda t: 0.0)
    result = bench.run(35.0, 35.5, lambda t: 2.0, lambda t: 0.0)
    assert result.tilt is not None
    assert result.tilt >= 2.0 * DEG
    assert result.reasons(AlertLimits()) == (Reason.ATTITUDE_LEVEL,)


def test_a_roll_is_no_difference_and_the_held_attitude_goes_on_turning() -> None:
    """40 deg/s: the filter's last solution is 8 deg back.  Held for 0.1 s, the attitude is 4 deg off."""
    bench = Bench()
    rolling = lambda t: 40.0 * max(0.0, t - 34.0)  # noqa: E731
    bench.run(0.0, 34.0, rolling, rolling)
    result = bench.run(34.0, 36.0, rolling, rolling)
    assert result.tilt == pytest.approx(0.05 * RADIAL * DEG, abs=0.01 * DEG)
    newest_ns = T0 + round(35.98 * S)
    held = bench.at(newest_ns + S // 10)
    assert held.tilt == pytest.approx((0.05 * RADIAL + 4.0) * DEG, rel=0.02)
    assert held.reasons(AlertLimits()) == (Reason.ATTITUDE_LEVEL,)


def test_an_uncertain_filter_does_not_make_a_device_invalid() -> None:
    bench = Bench()
    result = bench.run(0.0, 35.0, lambda t: 0.3, lambda t: 0.0, sd=0.45)
    assert result.unchecked == (Reason.UNCERTAIN,)
    assert result.tilt is not None
    assert result.tilt > 2.0 * DEG
    assert result.reasons(AlertLimits()) == ()


def test_the_filter_alone_has_the_level_of_its_sigma() -> None:
    of = config(("ins",))
    protection = AttitudeProtection(of, {"ins": NavSource(of.device[0])})
    alone = state(tilt_sd=0.3, heading_sd=1.0)
    assert protection.at(T0, alone, "filter").unchecked == (Reason.NOTHING_TO_COMPARE,)
    for k in range(160):
        protection.feed_filter(filtered(T0 + k * S // 5))
    result = protection.at(T0 + 32 * S, alone, "filter")
    assert result.tilt == pytest.approx(0.3 * RADIAL * DEG, rel=1e-3)
    assert result.unchecked == ()
    assert protection.at(T0 + 33 * S, state(tilt_sd=0.5), "filter").reasons(AlertLimits()) == (Reason.ATTITUDE_LEVEL,)


# ----------------------------------------------------------------------------------------------- through the pipeline


def fly(second: float, sds: tuple[float | None, float | None], **nav: Any) -> NavSolution:
    """Two devices, level for 10 s; then the second one rolled by ``second`` [deg] for 2 s.  sds : stated [deg]"""
    pipeline, solutions = Pipeline(config(**nav), None), list[NavSolution]()
    for k in range(12 * 50):
        t_ns = T0 + k * S // 50
        for name, roll, sd in zip(("ins", "ahrs"), (0.0, second if k >= 500 else 0.0), sds, strict=True):
            one = None if sd is None else sd * DEG
            pipeline.feed(
                name,
                Attitude(stamp=Stamp(t_ns), roll=roll * DEG, pitch=0.0, heading=0.0, roll_sd=one, pitch_sd=one),
            )
        solutions += [o for o in pipeline.tick(t_ns) if isinstance(o, NavSolution)]
    return solutions[-1]


def test_two_that_disagree_without_a_filter_make_the_attitude_invalid_with_its_reason() -> None:
    solution = fly(6.0, (0.05, 0.05))
    assert not solution.attitude_valid
    assert solution.attitude_reasons == (Reason.ATTITUDE_LEVEL,)
    assert Reason.ATTITUDE_LEVEL in solution.reasons
    assert solution.tilt_pl == pytest.approx((6.0 + 0.05 * RADIAL) * DEG, rel=1e-3)
    assert fly(6.0, (0.05, 0.05), alert_limits={"attitude_deg": 7.0}).attitude_valid


def test_devices_that_state_no_sigma_are_valid_and_say_that_they_are_uncertain() -> None:
    solution = fly(0.5, (None, None))
    assert solution.attitude_valid
    assert solution.attitude_unchecked == (Reason.UNCERTAIN,)
    assert solution.tilt_pl == pytest.approx((0.5 + 1.0 * RADIAL) * DEG, rel=1e-3)
    other = fly(0.5, (None, None), unstated_sd={"attitude_deg": [0.2, 2.0]})
    assert other.tilt_pl == pytest.approx((0.5 + 0.2 * RADIAL) * DEG, rel=1e-3)
    assert other.attitude_unchecked == (Reason.UNCERTAIN,)  # however small: it is not the device that states it
