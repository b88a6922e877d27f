"""Heights of one kind subtract to lengths; mixed ones raise; named functions lead from kind to kind."""

import operator
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.geodesy.atmosphere import Atmosphere
from fti.geodesy.geoid import load_geoid
from fti.geodesy.heights import (
    AGL,
    ELLIPSOID,
    MSL,
    PRESSURE,
    RECEIVER,
    Height,
    HeightKind,
    above_ground,
    from_ground,
    msl_to_pressure,
    pressure_to_msl,
    reset_altimeter,
    to_ellipsoid,
    to_ellipsoid_by_message,
    to_msl,
    to_point,
)
from fti.geodesy.rotations import mat_from_rpy
from fti.messages.outputs import Point
from tests.grids import needs_egm96

KINDS = [ELLIPSOID, MSL("egm96"), MSL("egm2008"), PRESSURE(), PRESSURE(100325.0), AGL(Point.P), AGL(Point.WHEELS)]
PAIRS = [(one, other) for one in KINDS for other in KINDS if one != other]
MIXING = [operator.sub, operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne, operator.add]
MUNICH = np.radians(48.1), np.radians(11.6)


@pytest.mark.parametrize(("one", "other"), PAIRS, ids=str)
def test_mixing_raises_with_both_kinds(one: HeightKind, other: HeightKind) -> None:
    for mix in MIXING:
        with pytest.raises(ValueError, match="height") as refused:
            mix(Height(500.0, one), Height(np.array([1.0, 2.0]), other))
        assert str(one) in str(refused.value)
        assert str(other) in str(refused.value)


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_one_kind_behaves_as_a_height_does(kind: HeightKind) -> None:
    low, high = Height(100.0, kind), Height(np.array([150.0, np.nan]), kind)
    assert high - low == pytest.approx([50.0, np.nan], nan_ok=True)
    assert isinstance(Height(150.0, kind) - low, float)
    for moved in (low + 20.0, 20.0 + low, np.float64(20.0) + low, low - -20.0):
        assert isinstance(moved, Height)
        assert moved.kind == kind
        assert moved.metres == 120.0
    assert (np.array([1.0, 2.0]) + low).metres == pytest.approx([101.0, 102.0])
    assert low == Height(100.0, kind)
    assert low != Height(101.0, kind)
    assert low < Height(101.0, kind)
    assert np.array_equal(high > low, [True, False])


def test_what_no_height_does() -> None:
    height = Height(100.0, ELLIPSOID)
    calls: list[tuple[Callable[[], object], str]] = [
        (lambda: operator.add(height, height), "only a length"),
        (lambda: 5.0 - height, "from a length"),
        (lambda: np.array([5.0]) - height, "from a length"),
        (lambda: height < 5.0, "plain number"),  # type: ignore[operator]
        (lambda: PRESSURE(0.0), "must be positive"),
    ]
    for call, words in calls:
        with pytest.raises(ValueError, match=words):
            call()
    with pytest.raises(TypeError):
        height * 2.0  # type: ignore[operator]
    assert height != 100.0
    assert "100.0 m ELLIPSOID" in str(height)


def test_a_height_does_not_change_with_the_array_it_was_made_from() -> None:
    values = np.array([1.0, 2.0])
    height = Height(values, ELLIPSOID)
    values[0] = 99.0
    assert np.asarray(height.metres)[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        np.asarray(height.metres)[0] = 3.0


# ------------------------------------------------------------------------------------------------------------ geoid


def test_an_undulation_of_47_m_is_in_the_message() -> None:
    """A receiver that says 500 m above sea level and 47 m undulation is 547 m above the ellipsoid, by its geoid."""
    assert to_ellipsoid_by_message(Height(500.0, MSL(RECEIVER)), 47.0) == Height(547.0, ELLIPSOID)


@needs_egm96
def test_sea_level_and_ellipsoid_by_the_geoid() -> None:
    geoid = load_geoid("egm96")
    up = to_ellipsoid(Height(np.array([0.0, 500.0]), MSL("egm96")), *MUNICH, geoid)
    assert up.metres == pytest.approx([46.0, 546.0], abs=2.0)  # EGM96 has 45 to 47 m around Munich
    back = to_msl(up, *MUNICH, geoid)
    assert back.metres == pytest.approx([0.0, 500.0], abs=1e-9)
    assert back.kind == MSL("egm96")


@needs_egm96
def test_a_height_of_another_geoid_is_refused() -> None:
    for model in ("egm2008", RECEIVER):
        with pytest.raises(ValueError, match="cannot be converted with the geoid egm96"):
            to_ellipsoid(Height(0.0, MSL(model)), *MUNICH, load_geoid("egm96"))


# --------------------------------------------------------------------------------------------------------- pressure


def test_ten_hectopascals_are_83_m() -> None:
    height = reset_altimeter(Height(0.0, PRESSURE(101325.0)), 102325.0)
    assert height.metres == pytest.approx(83.0, abs=0.5)
    assert height.kind == PRESSURE(102325.0)
    assert str(height.kind) == "PRESSURE(1023.25 hPa)"


def test_air_of_20_k_below_the_standard_costs_22_m_at_300_m() -> None:
    cold = Atmosphere(qnh=101325.0, deviation=-20.0)
    height = msl_to_pressure(Height(300.0, MSL("egm96")), cold, 101325.0)
    assert height.metres == pytest.approx(322.0, abs=0.5)
    assert pressure_to_msl(height, cold, "egm96").metres == pytest.approx(300.0, abs=1e-9)
    standard = pressure_to_msl(height, Atmosphere(), "egm96")  # who takes the air for standard
    assert standard.metres == pytest.approx(322.0, abs=0.5)


@given(
    metres=st.floats(-300.0, 6000.0),
    qnh=st.floats(95000.0, 105000.0),
    setting=st.floats(95000.0, 105000.0),
    deviation=st.floats(-50.0, 50.0),
)
def test_pressure_and_back(metres: float, qnh: float, setting: float, deviation: float) -> None:
    """There and back through any setting: rounding alone, and the setting of the altimeter drops out."""
    air, height = Atmosphere(qnh, deviation, station=400.0), Height(metres, MSL("egm2008"))
    result = msl_to_pressure(height, air, setting)
    for altimeter in (result, reset_altimeter(result, 101325.0)):
        assert pressure_to_msl(altimeter, air, "egm2008").metres == pytest.approx(metres, abs=1e-7)


# ---------------------------------------------------------------------------------------------------------- terrain


def test_above_ground_and_back() -> None:
    ground = Height(np.array([420.0, np.nan]), ELLIPSOID)
    agl = above_ground(Height(520.0, ELLIPSOID), ground, Point.ANTENNA)
    assert agl.kind == AGL(Point.ANTENNA)
    assert agl.metres == pytest.approx([100.0, np.nan], nan_ok=True)
    assert from_ground(agl, ground).metres == pytest.approx([520.0, np.nan], nan_ok=True)
    with pytest.raises(ValueError, match=r"MSL\(egm96\).*ELLIPSOID|ELLIPSOID.*MSL\(egm96\)"):
        above_ground(Height(520.0, MSL("egm96")), ground, Point.P)


def test_the_height_of_another_point() -> None:
    """An antenna 2 m below P at 98 m: P is at 100 m.  Upside down it is 2 m above P; on its side as high."""
    antenna, below = Height(98.0, AGL(Point.ANTENNA)), (0.0, 0.0, 2.0)
    for roll, expected in ((0.0, 100.0), (np.pi, 96.0), (np.pi / 2, 98.0)):
        at_p = to_point(antenna, Point.P, below, mat_from_rpy(roll, 0.0, 1.0))
        assert at_p.kind == AGL(Point.P)
        assert at_p.metres == pytest.approx(expected)
    ahead = to_point(antenna, Point.P, (10.0, 0.0, 0.0), mat_from_rpy(0.0, np.radians(30.0), 0.0))
    assert ahead.metres == pytest.approx(93.0)  # nose up: an antenna ahead of P is above it


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda h: to_ellipsoid_by_message(h, 47.0), "kind MSL, not AGL"),
        (lambda h: reset_altimeter(h, 1e5), "kind PRESSURE, not AGL"),
        (lambda h: pressure_to_msl(h, Atmosphere(), "egm96"), "kind PRESSURE, not AGL"),
        (lambda h: msl_to_pressure(h, Atmosphere(), 1e5), "kind MSL, not AGL"),
        (lambda h: above_ground(h, h, Point.P), "ground height above ELLIPSOID or MSL, not AGL"),
        (
            lambda h: above_ground(Height(9.0, PRESSURE()), Height(9.0, PRESSURE()), Point.P),
            "above ELLIPSOID or MSL, not PRESSURE",
        ),
        (lambda h: from_ground(h, Height(9.0, PRESSURE())), "above ELLIPSOID or MSL, not PRESSURE"),
        (lambda h: from_ground(h, h), "above ELLIPSOID or MSL"),
        (lambda h: to_point(Height(1.0, ELLIPSOID), Point.P, (0, 0, 1), np.eye(3)), "kind AGL, not ELLIPSOID"),
        (lambda h: from_ground(Height(1.0, ELLIPSOID), h), "kind AGL, not ELLIPSOID"),
    ],
)
def test_a_conversion_refuses_what_it_is_not_for(call: Callable[[Height], object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call(Height(100.0, AGL(Point.P)))
