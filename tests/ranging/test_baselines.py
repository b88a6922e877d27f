import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.ranging.baselines import Baselines
from fti.ranging.sensor import Validity

Array = NDArray[np.float64]

#: 4.3 GHz, 0.15 and 0.35 m: every look angle has other integers whose baselines disagree by 36 deg or more.
THREE = Baselines(wavelength=0.07, la=0.15, ar=0.35, look_limit=math.radians(40.0))


def noisy(sd: float) -> Baselines:
    return Baselines(THREE.wavelength, THREE.la, THREE.ar, sd, THREE.look_limit)


def test_look_angle_comes_back_through_lost_turns() -> None:
    look = np.radians(np.linspace(-39.9, 39.9, 4001))
    found, validity = THREE.resolve(THREE.phases(look))
    assert np.abs(found - look).max() < 1e-13
    assert (validity == Validity.VALID).all()
    assert np.abs(np.sin(look) * THREE.lr / THREE.wavelength).max() > 4.0  # turns were lost


def test_phases_close_and_rise_to_the_right() -> None:
    phases = THREE.phases(np.radians([-1.0, 0.0, 1.0]))
    assert phases[1] == pytest.approx([0.0, 0.0, 0.0], abs=1e-15)
    assert phases[2] == pytest.approx(2 * np.pi * np.sin(np.radians(1.0)) * np.array([0.15, 0.35, 0.5]) / 0.07)
    assert phases[0] == pytest.approx(-phases[2])


def test_third_baseline_as_printed_gives_another_angle() -> None:
    """Eq. 3 as printed weighs the sine of L-R by B_AR."""
    sine = np.sin(np.radians(10.0))
    weights = np.array([THREE.la, THREE.ar, THREE.ar])
    printed = weights @ [sine, sine, sine] / (THREE.la + THREE.ar + THREE.lr)
    assert np.degrees(np.arcsin(printed)) == pytest.approx(8.5, abs=0.05)
    assert np.degrees(THREE.resolve(THREE.phases(np.radians(10.0)))[0]) == pytest.approx(10.0, abs=1e-9)


def test_noise_of_the_look_angle_is_as_stated() -> None:
    antennas, look, n = noisy(0.02), np.radians(25.0), 4000
    found, validity = antennas.resolve(antennas.phases(np.full(n, look), np.random.default_rng(1)))
    assert (validity == Validity.VALID).mean() > 0.995
    good = found[validity == Validity.VALID]
    assert good.std() == pytest.approx(float(antennas.look_angle_sd(look)), rel=3.3 / np.sqrt(2 * n))
    assert good.mean() == pytest.approx(look, abs=3.3 * good.std() / np.sqrt(n))


@pytest.mark.parametrize("sd", [0.10, 0.14])
@pytest.mark.parametrize("look_deg", [5.0, 38.0])
def test_wrong_integers_are_as_frequent_as_stated(sd: float, look_deg: float, scale: int) -> None:
    """Binomial, 0.1 %; near the limit only one neighbour is left, so half as many are wrong."""
    antennas, look, n = noisy(sd), np.radians(look_deg), 8000 * scale
    found, _ = antennas.resolve(antennas.phases(np.full(n, look), np.random.default_rng(2)))
    wrong = np.abs(np.sin(found) - np.sin(look)) > 0.5 * antennas.wavelength / antennas.lr
    probability = antennas.wrong_integer_probability(look)
    assert wrong.mean() == pytest.approx(probability, abs=3.3 * np.sqrt(probability * (1 - probability) / n))
    assert 0.002 < probability < 0.1


def test_wrong_integers_are_seldom_accepted() -> None:
    """What passes for valid is wrong only where the right integers do not fit: one in a thousand."""
    antennas, look, n = noisy(0.11), np.radians(5.0), 20000
    found, validity = antennas.resolve(antennas.phases(np.full(n, look), np.random.default_rng(3)))
    wrong = np.abs(np.sin(found) - np.sin(look)) > 0.5 * antennas.wavelength / antennas.lr
    assert wrong.mean() > 0.01 and (validity == Validity.AMBIGUOUS).mean() > 0.15
    assert (wrong & (validity == Validity.VALID)).mean() < 0.002


def test_equal_baselines_do_not_resolve_unless_the_limit_does() -> None:
    equal = Baselines(0.07, 0.25, 0.25, look_limit=math.radians(40.0))
    assert equal.resolve(equal.phases(0.1))[1] == Validity.AMBIGUOUS
    narrow = Baselines(0.07, 0.25, 0.25, look_limit=math.radians(7.0))  # the next one lies 16 deg away
    found, validity = narrow.resolve(narrow.phases(0.1))
    assert validity == Validity.VALID and found == pytest.approx(0.1, abs=1e-12)
    assert narrow.wrong_integer_probability(0.1) == 0.0


def test_phases_that_fit_no_direction_are_weak() -> None:
    antennas = noisy(0.005)
    phases = antennas.phases(0.2)
    assert antennas.resolve(phases)[1] == Validity.VALID
    assert antennas.resolve(phases + np.array([0.3, -0.3, 0.0]))[1] == Validity.WEAK
    found, validity = antennas.resolve([np.nan, 0.0, 0.0])
    assert np.isnan(found) and validity == Validity.UNKNOWN


def test_wrong_figures_are_refused() -> None:
    for bad in (
        {"wavelength": 0.0},
        {"la": -0.1},
        {"ar": math.nan},
        {"phase_sd": -1e-3},
        {"look_limit": 0.0},
        {"look_limit": 1.6},
    ):
        with pytest.raises(ValueError, match=next(iter(bad))):
            Baselines(**({"wavelength": 0.07, "la": 0.15, "ar": 0.35} | bad))
