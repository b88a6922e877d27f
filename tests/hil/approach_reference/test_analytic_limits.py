"""Limits by theory: against scipy, and against the calibrated ones of the demonstration."""

import pytest
from scipy.stats import chi2, norm

from fti.hil.approach_reference.analytic_limits import chi_square_quantile, theoretical_limits
from fti.nav.integrity.reference import ApproachReference
from tests.helpers import ROOT

DEMO = ROOT / "configs" / "profiles" / "demo.csv"


@pytest.mark.parametrize("degrees", [7.0, 9.84, 30.0])
@pytest.mark.parametrize("beyond", [0.05, 1e-3, 1e-5])
def test_the_quantile_is_that_of_the_chi_square(degrees: float, beyond: float) -> None:
    assert chi_square_quantile(degrees, beyond) == pytest.approx(chi2.isf(beyond, degrees), rel=0.03)


def test_limits_are_those_of_independent_normal_residuals() -> None:
    reference = ApproachReference.parse(DEMO.read_text(), str(DEMO))
    beyond, k_eff = 0.01 / 4 / (7000.0 / 400.0), 400.0 / 50.0
    t1, t2, t3, t4 = theoretical_limits(reference)
    assert t1 == pytest.approx(chi2.isf(beyond, k_eff - 1), rel=0.03)
    assert (t2, t3) == pytest.approx((chi2.isf(beyond, 1), norm.isf(beyond / 2)))
    assert t4 == pytest.approx(norm.isf(beyond / k_eff))


def test_calibrated_limits_lie_about_them() -> None:
    """Within a factor of 2: a blunder in either (a missing square, a wrong share of Pfa in one test) is more."""
    for name in ("demo.csv", "demo_strict.csv"):
        reference = ApproachReference.parse((DEMO.parent / name).read_text(), name)
        limits = reference.header.limits
        for found, theory in zip(
            (limits.t1, limits.t2, limits.t3, limits.t4), theoretical_limits(reference), strict=True
        ):
            assert 0.5 < found / theory < 2.0
