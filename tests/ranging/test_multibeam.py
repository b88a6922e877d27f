"""The multi-beam altimeter: directions of table 7.6, ranges over planes by closed form."""

from __future__ import annotations

import numpy as np
import pytest

from fti.ranging.laser import Laser
from fti.ranging.multibeam import BEAMS_ACROSS_DEG, MultiBeam, beam_directions, beams_across
from tests.planes import looking_down, plane, to_plane


def test_the_directions_are_those_of_the_source() -> None:
    """Table 7.6: each set is symmetric, contains the nadir, and its 9 beams are 10 deg apart."""
    assert list(BEAMS_ACROSS_DEG) == [1, 3, 5, 7, 9]
    assert BEAMS_ACROSS_DEG[9] == tuple(range(-40, 50, 10))
    for number, angles in BEAMS_ACROSS_DEG.items():
        assert len(angles) == number and 0.0 in angles
        assert [-angle for angle in reversed(angles)] == list(angles)
    right = MultiBeam(beams=beams_across(3)).directions_s()[-1]
    assert right == pytest.approx([0.0, np.sin(np.radians(20.0)), np.cos(np.radians(20.0))], abs=1e-15)


def test_a_positive_angle_looks_forward_and_to_the_right() -> None:
    """Over level ground, heading north: the point is h tan(along) north and h tan(across) east."""
    sensor = MultiBeam(beams=((0.3, 0.5),))
    returns = sensor.measure(plane(), looking_down(100.0))
    point = looking_down(100.0).mats_ls[0] @ (returns.slant_range[0, 0] * returns.direction_s[0, 0])
    assert point == pytest.approx([100.0 * np.tan(0.5), 100.0 * np.tan(0.3), -100.0], abs=1e-6)


def test_every_beam_of_a_banked_aircraft_measures_its_own_range_to_a_slope() -> None:
    slopes, poses = (0.2, -0.1), looking_down([150.0, 220.0], roll=[0.2, -0.3], pitch=0.05, heading=1.0)
    sensor = MultiBeam(Laser(max_range=1000.0), beams_across(9))
    returns = sensor.measure(plane(*slopes), poses)
    rays = np.einsum("nij,kj->nki", poses.mats_ls, beam_directions(*np.transpose(sensor.beams))).reshape(-1, 3)
    expected = to_plane(np.repeat(poses.origins_l, 9, axis=0), rays, *slopes).reshape(2, 9)
    assert returns.valid.all() and returns.slant_range == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("beams", [(), ((0.0, 1.6),), ((-1.6, 0.0),), ((0.0, np.nan),)])
def test_a_sensor_without_beams_or_with_a_beam_that_looks_back_is_refused(
    beams: tuple[tuple[float, float], ...],
) -> None:
    with pytest.raises(ValueError, match="beams is"):
        MultiBeam(beams=beams)
