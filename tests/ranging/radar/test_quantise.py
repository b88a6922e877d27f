"""Steps of the RA-4500: the table of its maker."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fti.constants import FOOT
from fti.ranging.radar.altimeter import quantise_heights
from fti.ranging.radar.quantise import quantisation_step_ft


@given(st.lists(st.floats(-10.0, 70000.0), min_size=1, max_size=30))
def test_an_array_is_quantised_by_the_table(feet: list[float]) -> None:
    """The rows of the table by a search of numpy."""
    heights = np.array(feet) * FOOT
    found = np.clip(heights / FOOT, 0.0, None)
    step = np.array([1, 2, 5, 20, 50, 100])[np.searchsorted([119, 199, 499, 999, 2099], found)]
    expected = np.minimum(np.rint(found / step) * step, 65535.0) * FOOT
    np.testing.assert_allclose(quantise_heights(heights), expected, rtol=1e-12)


def test_nothing_is_farther_from_its_step_than_half() -> None:
    heights = np.linspace(0.0, 1000.0, 10_001)
    half = np.array([0.5 * quantisation_step_ft(h / FOOT) * FOOT for h in heights])
    assert (np.abs(quantise_heights(heights) - heights) <= half * (1 + 1e-12)).all()


def test_the_corners_of_the_table() -> None:
    """The printed first column, 199 ft, would show 133 ft as 133; the instrument shows it as 132 or 134."""
    feet = np.array([-3.0, 0.4, 119.0, 120.9, 133.0, 199.0, 201.0, 490.0, 508.0, 1020.0, 2130.0, 70000.0])
    shown = [0, 0, 119, 120, 132, 200, 200, 490, 500, 1000, 2100, 65535]
    np.testing.assert_allclose(quantise_heights(feet * FOOT) / FOOT, shown, rtol=1e-14)


def test_unknown_stays_unknown() -> None:
    assert np.isnan(quantise_heights([np.nan, 3.0])).tolist() == [True, False]
