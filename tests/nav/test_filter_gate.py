"""The gate: its quantiles, who is refused, and that nobody is locked out for ever."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from fti.nav.filter.aiding import Aiding, BaroAltitude, GnssHeight, GnssPosition, GnssVelocity
from fti.nav.filter.estimate import Start
from fti.nav.filter.gate import LIMITS, LOCKOUT_NS, Judgement, Standing, judge, noted, opened, rejected
from fti.nav.filter.states import Model

GNSS = GnssPosition(0.8, 0.2, 700.0, 2.0, 3.0)
HEIGHT = GnssHeight(GNSS)
BARO = BaroAltitude(700.0, 1.0)
SECOND = 1_000_000_000


@pytest.mark.parametrize("dof", [1, 2, 3])
def test_limits_are_the_quantiles_of_chi_square(dof: int) -> None:
    assert LIMITS[dof] == pytest.approx(chi2.isf(1e-4, dof), abs=1e-3)


def test_what_fits_is_believed_and_what_does_not_is_refused() -> None:
    assert judge({}, BARO, 0, 15.1, 1) is Judgement.BELIEVED
    assert judge({}, BARO, 0, 15.2, 1) is Judgement.REFUSED
    assert judge({}, BARO, 0, float("nan"), 1) is Judgement.REFUSED


def refused(aiding: Aiding) -> dict[str, Standing]:
    return noted(noted({}, aiding, 0, Judgement.BELIEVED), aiding, SECOND, Judgement.REFUSED)


def test_alone_it_is_let_in_again_after_the_lockout() -> None:
    books = refused(GNSS)
    assert judge(books, GNSS, SECOND + LOCKOUT_NS - 1, 1e6, 3) is Judgement.REFUSED
    assert judge(books, GNSS, SECOND + LOCKOUT_NS, 1e6, 3) is Judgement.LET_IN
    assert rejected(books) == ("gnss.position",)
    assert rejected(noted(books, GNSS, 7 * SECOND, Judgement.LET_IN)) == ()


def test_beside_others_that_are_believed_it_stays_out() -> None:
    books = noted(refused(HEIGHT), BARO, 3 * SECOND, Judgement.BELIEVED)
    assert judge(books, HEIGHT, SECOND + LOCKOUT_NS, 1e6, 1) is Judgement.REFUSED


def test_who_was_believed_once_does_not_vouch_for_ever() -> None:
    """An altimeter that was believed a second after, and then flew out of its range, had locked satellites out."""
    books = noted(refused(HEIGHT), BARO, 3 * SECOND, Judgement.BELIEVED)
    assert judge(books, HEIGHT, 3 * SECOND + LOCKOUT_NS - 1, 1e6, 1) is Judgement.REFUSED
    assert judge(books, HEIGHT, 3 * SECOND + LOCKOUT_NS, 1e6, 1) is Judgement.LET_IN


def test_a_height_does_not_vouch_for_the_level() -> None:
    level, _ = GNSS.apart()
    books = noted(refused(level), BARO, 5 * SECOND, Judgement.BELIEVED)
    assert judge(books, level, SECOND + LOCKOUT_NS, 1e6, 2) is Judgement.LET_IN


def test_a_velocity_bounds_nothing_and_is_never_forced_in() -> None:
    velocity = GnssVelocity(0.0, 0.0, 0.0, 0.1)
    books = noted({}, velocity, 0, Judgement.REFUSED)
    assert judge(books, velocity, 100 * SECOND, 1e6, 3) is Judgement.REFUSED


def test_what_is_let_in_opens_the_covariance_where_it_disagrees() -> None:
    here = Start(0.8, 0.2, 700.0, (50.0, 0.0, 0.0), 0.0, 0.0, 0.0, (1.0,) * 3, (0.1,) * 3, (0.01,) * 3).estimate(
        0, np.zeros(6), Model()
    )
    down = here.mat_en[:, 2]
    high = opened(here, BARO, np.array([30.0]))
    assert down @ high[:3, :3] @ down == pytest.approx(901.0)
    north = here.mat_en[:, 0]
    assert north @ high[:3, :3] @ north == pytest.approx(1.0)
    wide = opened(here, GNSS, np.array([100.0, 0.0, 0.0]))
    assert north @ wide[:3, :3] @ north == pytest.approx(10_001.0)
    assert wide[6, 6] > 0.1**2
    level = opened(here, GNSS.apart()[0], np.array([100.0, 0.0]))
    assert north @ level[:3, :3] @ north == pytest.approx(10_001.0)
    assert down @ level[:3, :3] @ down == pytest.approx(1.0)
