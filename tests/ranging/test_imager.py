from typing import Any

import numpy as np
import pytest

from fti.ranging.imager import RangeImager
from fti.ranging.laser import Laser
from fti.ranging.scanner import points_l
from tests.planes import looking_down, plane, to_plane

FLAT = plane()


def test_a_scanner_would_need_the_printed_rate() -> None:
    """Section 2.1.5: 6.4 MHz for 200 x 200 pixels at 160 Hz."""
    assert RangeImager(pixels=(200, 200), frame_rate=160.0).scanner_rate == 6.4e6


def test_overlap_by_half_needs_the_printed_interval() -> None:
    """Eq. 7.6: 1.02 s at 300 m, 170 m/s and 60 deg; the matrices then overlap by half of their length."""
    imager = RangeImager()
    interval = float(imager.overlap_interval(300.0, 170.0))
    assert f"{interval:.2f}" == "1.02"
    assert interval * 170.0 == pytest.approx(0.5 * float(imager.footprint(300.0)[0]))


def test_the_pair_with_the_largest_overlap_times_interval_is_that_of_the_source() -> None:
    """Fig. 7.37: 1 s at 2 Hz, 300 m, 170 m/s and 60 deg.  Without a frame rate the peak is at L / 2v."""
    imager = RangeImager()
    assert imager.best_interval(300.0, 170.0) == 1.0
    fine = RangeImager(frame_rate=1000.0)
    length = 2.0 * 300.0 * np.tan(np.radians(30.0))
    assert fine.best_interval(300.0, 170.0) == pytest.approx(length / (2.0 * 170.0), abs=0.001)
    assert float(imager.overlap_area(300.0, 170.0, 1.0)) == pytest.approx(length * (length - 170.0))
    assert imager.overlap_area(300.0, 170.0, [0.0, 3.0]).tolist() == pytest.approx([length**2, 0.0])


def test_a_frame_rate_that_is_too_low_leaves_its_first_pair() -> None:
    assert RangeImager(frame_rate=0.2).best_interval(300.0, 170.0) == 5.0


def test_pixels_are_those_of_a_pinhole() -> None:
    """x forward with the column, y right with the row, the boresight in the middle; edges half a pixel inside."""
    rays = RangeImager(pixels=(5, 3), field_of_view=(1.0, 0.5)).directions_s()
    assert rays.shape == (3, 5, 3) and np.linalg.norm(rays, axis=-1) == pytest.approx(np.ones((3, 5)))
    assert rays[1, 2].tolist() == [0.0, 0.0, 1.0]
    on_plane = rays[..., :2] / rays[..., 2:]
    assert on_plane[0, 4] == pytest.approx([np.tan(0.5) * 4 / 5, -np.tan(0.25) * 2 / 3])
    assert RangeImager(pixels=(1, 1)).directions_s().tolist() == [[[0.0, 0.0, 1.0]]]


def test_level_ground_is_a_regular_grid_of_the_closed_form() -> None:
    imager = RangeImager(pixels=(20, 12), field_of_view=(1.0, 0.8))
    at = looking_down([300.0, 120.0])
    returns = imager.measure(FLAT, at)
    rays = imager.directions_s()
    for k, height in enumerate((300.0, 120.0)):
        assert np.abs(returns.slant_range[k] * rays[..., 2] / height - 1.0).max() < 1e-9
    points = points_l(at, returns)
    assert points.shape == (2, 12, 20, 3)
    along, across = (float(size) for size in imager.footprint(300.0))
    assert np.diff(points[0, :, :, 1], axis=1) == pytest.approx(np.full((12, 19), along / 20), rel=1e-9)  # north
    assert np.diff(points[0, :, :, 0], axis=0) == pytest.approx(np.full((11, 20), across / 12), rel=1e-9)  # east


@pytest.mark.parametrize(("slope_east", "slope_north"), [(0.3, -0.2), (-0.1, 0.5)])
def test_a_slope_has_the_closed_form(slope_east: float, slope_north: float) -> None:
    imager = RangeImager(pixels=(30, 25))
    at = looking_down([350.0, 200.0], [0.2, -0.4], [0.1, -0.1], 1.0)
    returns = imager.measure(plane(slope_east, slope_north), at)
    rays = (at.mats_ls[:, None, None] @ imager.directions_s()[..., None])[..., 0]
    for k in range(2):
        expected = to_plane(at.origins_l[k], rays[k].reshape(-1, 3), slope_east, slope_north).reshape(25, 30)
        reached = expected < 1000.0
        assert reached.mean() > 0.9 and (returns.valid[k] == reached).all()
        assert np.abs(returns.slant_range[k] / expected - 1.0)[reached].max() < 1e-9


def test_both_returns_of_every_pixel() -> None:
    returns = RangeImager(Laser(1000.0, returns="both"), pixels=(4, 3)).measure(FLAT, looking_down([100.0, 200.0]))
    assert returns.slant_range.shape == (2, 3, 4, 2) and returns.direction_s.shape == (2, 3, 4, 2, 3)


@pytest.mark.parametrize(
    "bad",
    [
        {"pixels": (0, 10)},
        {"pixels": (10, -1)},
        {"pixels": (10,)},
        {"field_of_view": (0.0, 1.0)},
        {"field_of_view": (1.0, 3.2)},
        {"frame_rate": 0.0},
    ],
)
def test_impossible_imagers_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        RangeImager(**bad)
