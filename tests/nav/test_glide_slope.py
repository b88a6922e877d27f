"""Glide-slope deviation: closed forms, dots, validity."""

import math

import pytest
from msgspec.structs import replace

from fti.messages.outputs import ClearanceIntegrity, IntegrityState
from fti.messages.reasons import Reason
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.glide_slope import HeightDeviation, PathPosition, deviation, dots, glide_slope

GLIDE = math.radians(3.0)
OK = ClearanceIntegrity(
    t_ns=5, t_valid_ns=4, state=IntegrityState.OK, reasons=(), valid=True, t1_ratio=0.3, t4_ratio=0.3
)
HIGH = HeightDeviation(10.0, 1.0)


def test_10_m_high_at_1000_m_before_the_threshold_is_0_44_deg(path: ApproachPath) -> None:
    found = math.degrees(deviation(1000.0 + path.x_gpi, 10.0, GLIDE))
    assert found == pytest.approx(0.44, abs=0.005)
    assert math.degrees(math.atan(10.0 / 1000.0)) == pytest.approx(0.57, abs=0.005)  # what eq. 7.5 prints


def test_on_the_path_is_zero_and_below_is_negative() -> None:
    assert deviation(2000.0, 0.0, GLIDE) == 0.0
    assert deviation(2000.0, -5.0, GLIDE) < 0.0


@pytest.mark.parametrize(("deg", "shown", "clamped"), [(0.36, 1.0, False), (-0.72, -2.0, False), (0.73, 2.0, True)])
def test_a_dot_is_0_36_deg_at_3_deg(deg: float, shown: float, clamped: bool) -> None:
    found = dots(math.radians(deg), GLIDE)
    assert found[0] == pytest.approx(shown, abs=1e-9)
    assert found[1] is clamped


def test_needle_height_and_navigation_stand_side_by_side(path: ApproachPath) -> None:
    alt = float(path.alt_path(1000.0)) + 12.0
    result = glide_slope(OK, path, PathPosition(1000.0, -3.0, alt), HIGH)
    assert result.valid
    assert (result.t_ns, result.t_valid_ns, result.dh) == (5, 4, 10.0)
    assert result.dh_nav == pytest.approx(12.0)
    assert result.sd == pytest.approx(1e-3)
    assert result.deviation == pytest.approx(deviation(1000.0, 10.0, GLIDE))


def test_below_150_m_there_are_only_metres(path: ApproachPath) -> None:
    result = glide_slope(OK, path, PathPosition(149.0, 0.0, 210.0), HIGH)
    assert (result.valid, result.reasons, result.deviation, result.dots) == (False, (Reason.BELOW_150_M,), None, None)
    assert (result.dh, result.dh_sd) == (10.0, 1.0)
    assert glide_slope(OK, path, PathPosition(150.0, 0.0, 210.0), HIGH).valid


@pytest.mark.parametrize(
    ("integrity", "valid"),
    [
        (replace(OK, state=IntegrityState.MONITOR), True),
        (replace(OK, t4_ratio=1.1), False),
        (replace(OK, t1_ratio=1.1), False),
        (replace(OK, state=IntegrityState.CAUTION), False),
        (replace(OK, state=IntegrityState.ALERT), False),
        (replace(OK, state=IntegrityState.ACQUIRE, t1_ratio=None, t4_ratio=None), False),
    ],
)
def test_valid_only_while_the_monitor_vouches(path: ApproachPath, integrity: ClearanceIntegrity, valid: bool) -> None:
    result = glide_slope(integrity, path, PathPosition(1000.0, 0.0, 260.0), HIGH)
    assert result.valid is valid
    assert (Reason.INTEGRITY in result.reasons) is not valid


def test_without_a_position_everything_is_unknown(path: ApproachPath) -> None:
    result = glide_slope(OK, path, None, None)
    assert (result.valid, result.s, result.dh, result.deviation) == (False, None, None, None)
    assert Reason.NO_POSITION in result.reasons
