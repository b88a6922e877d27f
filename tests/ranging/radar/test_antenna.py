"""Antenna gain between its two cuts."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.ranging.radar.antenna import NARROW, WIDE, Antenna, AntennaCut, cosine_antenna, cosine_cut, from_db
from fti.ranging.radar.dome import sphere

Array = NDArray[np.float64]

ANGLES = np.radians(np.linspace(-170.0, 170.0, 69))
#: An antenna that looks different to all four sides; in dB per square radian, the blend of two parabolas is exact.
LOPSIDED = Antenna(
    AntennaCut(ANGLES, 9.0 - np.where(ANGLES > 0, 20.0, 30.0) * ANGLES**2),
    AntennaCut(ANGLES, 9.0 - np.where(ANGLES > 0, 40.0, 60.0) * ANGLES**2),
)


def ray(off: Array, around: float) -> Array:
    """Unit vectors off the boresight, towards the right wing (around 0) or forward (around 90 deg)."""
    return np.stack((np.sin(off) * np.sin(around), np.sin(off) * np.cos(around), np.cos(off)), axis=-1)


def test_on_the_cuts_it_is_the_cut() -> None:
    np.testing.assert_allclose(LOPSIDED.gain_dbi(ray(ANGLES, 0.0)), LOPSIDED.azimuth.gains_dbi, atol=1e-9)
    np.testing.assert_allclose(LOPSIDED.gain_dbi(ray(ANGLES, np.pi / 2)), LOPSIDED.elevation.gains_dbi, atol=1e-9)


@pytest.mark.parametrize(
    ("around", "az", "el"), [(0.6, 20.0, 40.0), (2.0, 30.0, 40.0), (4.0, 30.0, 60.0), (-0.4, 20.0, 60.0)]
)
def test_lines_of_equal_gain_are_ellipses_between_parabolic_cuts(around: float, az: float, el: float) -> None:
    """G = 9 - a y^2 - b x^2 with x, y the angle's parts: sectors take the sides of the cuts that they lie between."""
    off = ANGLES[ANGLES > 0]
    expected = 9.0 - az * (off * np.cos(around)) ** 2 - el * (off * np.sin(around)) ** 2
    np.testing.assert_allclose(LOPSIDED.gain_dbi(ray(off, around)), expected, atol=1e-9)


@pytest.mark.parametrize(("antenna", "azimuth_deg", "elevation_deg"), [(WIDE, 35.0, 26.0), (NARROW, 15.0, 15.0)])
def test_peak_and_half_power(antenna: Antenna, azimuth_deg: float, elevation_deg: float) -> None:
    """Figures of fig. 2.9 and 7.19; the table is linear in dB between steps of 0.5 deg."""
    assert antenna.gain(ray(np.zeros(1), 0.0))[0] == pytest.approx(10.0)
    for side in (-1.0, 1.0):
        across, along = np.radians(side * azimuth_deg), np.radians(side * elevation_deg)
        assert antenna.gain(ray(np.array([across]), 0.0))[0] == pytest.approx(5.0, rel=1e-3)
        assert antenna.gain(ray(np.array([along]), np.pi / 2))[0] == pytest.approx(5.0, rel=1e-3)


def test_an_antenna_radiates_no_more_than_it_is_given() -> None:
    """Integral of the gain over the sphere, at most 4 pi.  The wide one radiates most of it only if the printed angles
    count from the boresight: as full widths it would waste three quarters.
    """
    whole = sphere(40)
    share = [float(a.gain(whole.rays) @ whole.solid_angles / (4.0 * np.pi)) for a in (WIDE, NARROW)]
    as_full_widths = cosine_antenna(float(np.radians(35.0)), float(np.radians(26.0)))
    assert 0.85 < share[0] < 0.90
    assert 0.20 < share[1] < 0.30
    assert as_full_widths.gain(whole.rays) @ whole.solid_angles / (4.0 * np.pi) < 0.26


def test_floor_stands_for_side_lobes_and_the_back() -> None:
    antenna = cosine_antenna(0.3, 0.3, peak_dbi=12.0, floor_db=-25.0)
    assert antenna.gain_dbi(np.array([0.0, 0.0, -1.0])) == pytest.approx(-13.0)


def test_no_gain_beyond_the_cuts() -> None:
    cut = AntennaCut(np.radians([-40.0, 0.0, 40.0]), np.array([-3.0, 9.0, -3.0]))
    antenna = Antenna(cut, cosine_cut(1.0, 9.0, -30.0))
    assert antenna.gain(ray(np.radians([41.0]), 0.0))[0] == 0.0
    assert antenna.gain(ray(np.radians([41.0]), 0.3))[0] == 0.0
    assert antenna.gain(np.array([np.sin(0.7), 0.0, np.cos(0.7)])) > 0.5


def test_cuts_of_different_reference_levels_are_refused() -> None:
    """One in dBi, the other under its peak."""
    with pytest.raises(ValueError, match=r"10\.0 dBi \(azimuth\), 0\.0 dBi \(elevation\)"):
        Antenna(cosine_cut(0.5, 10.0, -30.0), cosine_cut(0.5, 0.0, -30.0))


def test_levels_and_ratios() -> None:
    np.testing.assert_allclose(from_db([0.0, 10.0, -20.0]), [1.0, 10.0, 0.01])


@pytest.mark.parametrize(
    ("angles", "gains", "why"),
    [
        ([-1.0, 0.0, 1.0], [0.0, 1.0], "must both be"),
        ([0.0, -1.0], [0.0, 1.0], "ascend"),
        ([0.1, 1.0], [0.0, 1.0], "boresight"),
        ([-1.0, 1.0], [0.0, np.nan], "finite"),
    ],
)
def test_a_cut_is_checked(angles: list[float], gains: list[float], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        AntennaCut(np.array(angles), np.array(gains))


@pytest.mark.parametrize(("hpbw", "floor"), [(0.0, -30.0), (3.2, -30.0), (np.nan, -30.0), (0.5, -2.0)])
def test_a_cosine_cut_is_checked(hpbw: float, floor: float) -> None:
    with pytest.raises(ValueError, match="must lie"):
        cosine_cut(hpbw, 10.0, floor)
