import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import integrate, stats
from scipy.special import lambertw

from fti.ranging.laser import Laser
from fti.ranging.reflectance import REFLECTANCE
from fti.ranging.sensor import Returns, Validity
from fti.ranging.weather import LIDAR_RATIO, Cloud, cross_clouds, fog, fog_extinction
from fti.terrain.landscape import Cover
from tests.planes import looking_down, plane

Array = NDArray[np.float64]

FLAT = plane()
GRASS = REFLECTANCE[Cover.GRASS]


def laser(*weather: Cloud, returns: str = "first") -> Laser:
    return Laser(500.0, 0.2, pulse_length=10e-9, weather=weather, returns=returns)  # type: ignore[arg-type]


GATE = laser().min_range


# ----------------------------------------------------------------------------------------------------------- extinction


def test_extinction_follows_from_the_visibility() -> None:
    """Koschmieder: at the distance V a contrast of 1 has sunk to 0.02.  Kim: how it goes on to 905 nm."""
    for visibility in (50.0, 400.0, 3000.0, 20_000.0):
        assert np.exp(-fog_extinction(visibility, 550e-9) * visibility) == pytest.approx(0.02)
    assert fog_extinction(200.0) == pytest.approx(3.912 / 200.0, rel=1e-4)  # dense: the same at every wavelength
    for visibility, exponent in ((750.0, 0.25), (3000.0, 0.82), (8000.0, 1.3), (20_000.0, 1.3), (60_000.0, 1.6)):
        ratio = fog_extinction(visibility) / fog_extinction(visibility, 550e-9)
        assert ratio == pytest.approx((905 / 550) ** -exponent)


def test_visibility_must_be_positive() -> None:
    for bad in (0.0, -5.0, np.nan):
        with pytest.raises(ValueError, match="visibility"):
            fog_extinction(bad)


@pytest.mark.parametrize(
    ("bad", "what"),
    [((200.0, 100.0, 0.1), "top"), ((0.0, 1.0, -0.1), "extinction"), ((0.0, 1.0, 0.1, -1.0), "variation")],
)
def test_impossible_clouds_are_refused(bad: tuple[float, ...], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        Cloud(*bad)


# --------------------------------------------------------------------------------------------------------------- fading


@pytest.mark.parametrize("roll", [0.0, 0.6])
def test_fog_shortens_the_reach(roll: float) -> None:
    """R exp(sigma R) = R_0: R = W(sigma R_0) / sigma with Lambert's W.  Without a pulse length fog answers nothing."""
    clear = 500.0 * np.sqrt(GRASS * np.cos(roll) / 0.2)
    sigma = 1e-3
    limit = float(lambertw(sigma * clear).real) / sigma
    assert limit < 0.7 * clear
    heights = limit * np.cos(roll) * np.array([1.0 - 1e-6, 1.0 + 1e-6])
    returns = Laser(500.0, 0.2, weather=(Cloud(-np.inf, 1e4, sigma),)).measure(FLAT, looking_down(heights, roll))
    assert returns.validity.tolist() == [Validity.VALID, Validity.WEAK]


def test_light_fades_on_both_ways_through_each_layer() -> None:
    clouds = (Cloud(50.0, 80.0, 2e-3), Cloud(70.0, 150.0, 3e-3))
    at = looking_down(200.0, 0.5)
    faded = Laser(500.0, 0.2, weather=clouds).measure(FLAT, at).power / Laser(500.0, 0.2).measure(FLAT, at).power
    assert faded == pytest.approx([np.exp(-2.0 * (30.0 * 2e-3 + 80.0 * 3e-3) / np.cos(0.5))])


@pytest.mark.parametrize("climb", [-0.6, 0.0, 0.3])
@pytest.mark.parametrize("up", [50.0, 140.0, 300.0])
def test_the_way_through_a_layer_in_any_direction(climb: float, up: float) -> None:
    """Against the share of a finely divided ray that lies inside."""
    direction = np.array([[np.sqrt(1.0 - climb**2), 0.0, climb]])
    air = cross_clouds([Cloud(100.0, 200.0, 0.01)], np.array([[0.0, 0.0, up]]), direction, None)
    along = np.linspace(0.0, 700.0, 70_001)
    inside = (up + climb * along >= 100.0) & (up + climb * along <= 200.0)
    expected = np.exp(-2.0 * 0.01 * 0.01 * np.count_nonzero(inside))
    assert air.transmission(np.array([[700.0]]))[0, 0] == pytest.approx(expected, abs=3e-4)


# -------------------------------------------------------------------------------------------------------- early returns


def test_the_layer_returns_the_power_of_the_lidar_equation() -> None:
    """The integral of beta exp(-2 sigma r) over one pulse length, against rho / pi of a Lambertian surface."""
    sigma = 0.04
    air = cross_clouds([Cloud(100.0, 400.0, sigma)], np.array([[0.0, 0.0, 450.0]]), np.array([[0.0, 0.0, -1.0]]), None)
    where, reflectance = air.echoes(GATE, np.array([np.inf]))
    beta, _ = integrate.quad(lambda r: sigma / LIDAR_RATIO * np.exp(-2.0 * sigma * r), 0.0, GATE)
    assert where[0, 0] == 50.0 and reflectance[0, 0] / np.pi == pytest.approx(beta)


def test_a_layer_thinner_than_half_a_pulse_returns_less() -> None:
    """Its whole depth is lit, 0.5 m of it; so is what is left of a thick one above the ground."""
    down, from_above = np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, 450.0]])
    beta, _ = integrate.quad(lambda r: 0.04 / LIDAR_RATIO * np.exp(-2.0 * 0.04 * r), 0.0, 0.5)
    for base, ground in ((399.5, np.inf), (100.0, 50.5)):
        _, reflectance = cross_clouds([Cloud(base, 400.0, 0.04)], from_above, down, None).echoes(
            GATE, np.array([ground])
        )
        assert reflectance[0, 0] / np.pi == pytest.approx(beta)


def test_what_lies_before_the_gate_takes_its_share() -> None:
    """A haze above the cloud; and, inside the cloud, the blind way c T_p / 2."""
    haze, cloud = Cloud(300.0, 400.0, 2e-3), Cloud(100.0, 200.0, 0.04)
    down, no_ground = np.array([[0.0, 0.0, -1.0]]), np.array([np.inf])
    _, clear = cross_clouds([cloud], np.array([[0.0, 0.0, 450.0]]), down, None).echoes(GATE, no_ground)
    _, hazy = cross_clouds([haze, cloud], np.array([[0.0, 0.0, 450.0]]), down, None).echoes(GATE, no_ground)
    assert hazy[0, 1] == pytest.approx(clear[0, 0] * np.exp(-2.0 * 100.0 * 2e-3))
    where, inside = cross_clouds([cloud], np.array([[0.0, 0.0, 150.0]]), down, None).echoes(GATE, no_ground)
    assert where[0, 0] == GATE and inside[0, 0] == pytest.approx(clear[0, 0] * np.exp(-2.0 * GATE * 0.04))


def test_a_cloud_is_reported_as_ground() -> None:
    """The recorded approach: on the way down the range falls to its least, stays there, and is right below the base."""
    up = np.arange(700.0, 0.0, -5.0)
    returns = laser(Cloud(102.0, 352.0, 0.04)).measure(FLAT, looking_down(up))
    rho = np.pi / (2.0 * LIDAR_RATIO) * (1.0 - np.exp(-2.0 * 0.04 * GATE))
    sees_cloud = 500.0 * np.sqrt(rho / 0.2)
    above, inside, below = up > 352.0, (up > 102.0) & (up < 352.0), up < 102.0
    expected = np.where(above & (up - 352.0 < sees_cloud), up - 352.0, np.nan)
    expected[inside], expected[below] = GATE, up[below]
    assert returns.slant_range == pytest.approx(expected, nan_ok=True)
    assert 75.0 < np.nanmax(expected[above]) < sees_cloud < 120.0
    assert returns.valid.tolist() == np.isfinite(expected).tolist(), "an early return is not marked"
    assert (returns.validity[np.isnan(expected)] == Validity.WEAK).sum() > 10, "ground behind the cloud is too weak"


def test_last_return_is_the_ground_through_a_thin_cloud() -> None:
    cloud = Cloud(180.0, 200.0, 0.03)
    at = looking_down(240.0, 0.3)
    both = laser(cloud, returns="both").measure(FLAT, at).slant_range[0]
    assert both == pytest.approx(np.array([40.0, 240.0]) / np.cos(0.3))
    assert laser(cloud, returns="last").measure(FLAT, at).slant_range == pytest.approx(both[1:])


def test_a_cloud_behind_the_ground_is_not_seen() -> None:
    for returns in ("first", "last"):
        result = laser(Cloud(-300.0, -10.0, 0.1), returns=returns).measure(FLAT, looking_down([20.0, 60.0]))
        assert result.slant_range == pytest.approx([20.0, 60.0]) and (result.power > 0.0).all()


# ----------------------------------------------------------------------------------------------------------- statistics


def shares(returns: Returns, ground: float) -> tuple[float, float]:
    """Of the pulses: those that the cloud answers, and those that the ground answers."""
    early = returns.valid & (returns.slant_range < ground - 1.0)
    return float(early.mean()), float((returns.valid & ~early).mean())


@pytest.mark.parametrize("variation", [0.4, 1.0])
def test_how_often_a_cloud_answers_and_how_often_the_ground(variation: float, scale: int) -> None:
    """The extinction is gamma distributed, so both are values of its distribution.

    The cloud answers above g_1: 1 - exp(-2 s g_1 GATE) = (2 S / pi) 0.2 (d / 500 m)^2; else the ground does below g_2:
    exp(-2 s g_2 L) = (0.2 / rho) (h / 500 m)^2.  Limits of 4.4 sigma, 1e-5 for each of four shares.
    """
    pulses, sigma, above, thick, height = 4000 * scale, 0.02, 80.0, 30.0, 260.0
    cloud = Cloud(height - above - thick, height - above, sigma, variation)
    returns = laser(cloud).measure(FLAT, looking_down(np.full(pulses, height)), np.random.default_rng(7))
    law = stats.gamma(variation**-2, scale=variation**2)
    answers = -np.log1p(-2.0 * LIDAR_RATIO / np.pi * 0.2 * (above / 500.0) ** 2) / (2.0 * sigma * GATE)
    passes = -np.log(0.2 / GRASS * (height / 500.0) ** 2) / (2.0 * sigma * thick)
    expected = law.sf(answers), law.cdf(min(answers, passes))
    assert 0.05 < expected[0] < 0.95 and 0.05 < expected[1] < 0.95
    for share, probability in zip(shares(returns, height), expected, strict=True):
        assert abs(share - probability) < 4.4 * np.sqrt(probability * (1.0 - probability) / pulses)


@pytest.mark.parametrize("variation", [0.3, 1.5])
def test_extinction_has_the_mean_and_the_spread_that_are_asked_for(variation: float) -> None:
    """n = 20000; 5 sigma of the mean; the spread of a gamma distribution with its kurtosis within 6 %."""
    many = np.zeros((20_000, 3)) - [0.0, 0.0, 1.0]
    air = cross_clouds([Cloud(0.0, 9.0, 0.02, variation)], many, many, np.random.default_rng(10))
    assert abs(air.extinction.mean() / 0.02 - 1.0) < 5.0 * variation / np.sqrt(20_000)
    assert air.extinction.std() / 0.02 == pytest.approx(variation, rel=0.06)


def test_variation_is_drawn_from_the_generator_alone() -> None:
    at, sky = looking_down(np.full(500, 300.0)), laser(Cloud(150.0, 220.0, 0.02, variation=1.0))
    one, same, other = (sky.measure(FLAT, at, np.random.default_rng(seed)) for seed in (8, 8, 9))
    assert one.slant_range.tobytes() == same.slant_range.tobytes() != other.slant_range.tobytes()
    still = sky.measure(FLAT, at)
    assert len(np.unique(still.slant_range)) == 1, "without random numbers every pulse meets the mean extinction"


def test_fog_lies_on_the_ground() -> None:
    """Inside it the laser is blinded from the least range on; above it sees the fog's top."""
    returns = laser(fog(visibility=80.0, top=60.0)).measure(FLAT, looking_down([30.0, 90.0]))
    assert returns.slant_range == pytest.approx([GATE, 30.0])
