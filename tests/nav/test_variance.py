"""Variances against the full non-linear chain: a pose drawn, turned exactly, and a ray cast on the plane."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.rotations import mat_from_rpy
from fti.nav.altimetry.range_prediction import Prediction, Predictor
from fti.nav.altimetry.variance import (
    ErrorModel,
    footprint_covariance,
    height_variance,
    pose_cov,
    range_row,
    range_variance,
    sampled_height_variance,
    sampled_range_variance,
)
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn
from fti.ranging.sensor import RangingSensor
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

LASER = Laser(max_range=3000.0)
ABOVE, LEVER_B = 300.0, (4.0, -1.0, 2.0)
#: 2 m, 1.5 m of elevation, 0.3 m of the instrument, half a degree.
POSITION_SD, DEM_SD, RANGE_SD, ATTITUDE_SD = 2.0, 1.5, 0.3, math.radians(0.5)
WITHIN = 0.05
#: Full width of a beam, slope and look [deg]: inside a very wide one, and beyond the edge of a usual one.
WIDE = [(140.0, slope, tilt) for slope in (0.0, 15.0, 30.0) for tilt in (0.0, 15.0, 30.0)]
WIDE += [(40.0, 0.0, 30.0), (40.0, 10.0, 30.0), (40.0, 0.0, 40.0), (40.0, 20.0, 15.0)]


class KnownReceiver(NearestReturn):
    """The receiver aboard is the model's own: no error of the model."""

    @property
    def model_beam(self) -> None:  # type: ignore[override]
        return None


def sloping(slope: float, half: float = 2000.0) -> Terrain:
    """A plane that climbs to the north with this angle [rad]."""
    at = np.array([-half, half])
    return Terrain.from_array(math.tan(slope) * at[:, None] * np.ones((1, 2)), 2 * half, east0=-half, north0=-half)


def look(pitch: float, heading: float, sensor: RangingSensor = LASER, slope: float = 0.0) -> tuple[Predictor, Array]:
    return Predictor(sloping(slope), sensor, LEVER_B), mat_from_rpy(0.0, pitch, heading)


def turned(mat_nb: Array, psi: Array) -> Array:
    """exp([psi x]) mat_nb, exactly (Rodrigues), for n rotation vectors."""
    angle = np.linalg.norm(psi, axis=-1)[:, None, None]
    zero = np.zeros(len(psi))
    x, y, z = psi.T
    skew = np.stack((zero, -z, y, z, zero, -x, -y, x, zero), axis=-1).reshape(-1, 3, 3)
    sine, versed = np.sinc(angle / np.pi), 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.asarray((np.eye(3) + sine * skew + versed * (skew @ skew)) @ mat_nb)


def drawn(
    predictor: Predictor, mat_nb: Array, rng: np.random.Generator, cov: Array, n: int
) -> tuple[Prediction, Array]:
    """Predictions at n erroneous poses, over ground of erroneous height; and those heights."""
    errors = rng.multivariate_normal(np.zeros(6), cov, n)
    dem = DEM_SD * rng.standard_normal(n)
    north, east, down = errors[:, :3].T
    points = np.stack((east, north, ABOVE - down - dem), axis=-1)  # ground that is higher is a P that is lower
    return predictor.predict_local(points, turned(mat_nb, errors[:, 3:])), dem


COV = pose_cov((POSITION_SD, POSITION_SD, 1.0), ATTITUDE_SD)


@pytest.mark.parametrize("slope_deg", [0.0, 10.0, 20.0, 30.0])
@pytest.mark.parametrize("look_deg", [0.0, 15.0, 30.0])
@pytest.mark.parametrize("heading_deg", [0.0, 120.0, 180.0])
def test_range_and_height_within_5_percent(slope_deg: float, look_deg: float, heading_deg: float, scale: int) -> None:
    slope, pitch, heading = np.radians((slope_deg, look_deg, heading_deg))
    predictor, mat_nb = look(pitch, heading, slope=slope)
    rng, n = np.random.default_rng(3), 3000 * scale
    found, _ = drawn(predictor, mat_nb, rng, COV, n)
    noise = RANGE_SD * rng.standard_normal(n)
    truth = predictor.predict_local([0.0, 0.0, ABOVE], mat_nb)
    measured = truth.slant_range + noise
    errors = ErrorModel(COV, RANGE_SD, DEM_SD, dem_length=math.inf)
    sigma = math.sqrt(range_variance(truth, errors, nearest=False)[0])
    assert sigma == pytest.approx(np.std(measured - found.slant_range), rel=WITHIN)
    height = found.height_p + (measured - found.slant_range) * found.cosine
    assert math.sqrt(height_variance(truth, errors, nearest=False)[0]) == pytest.approx(np.std(height), rel=WITHIN)


@pytest.mark.parametrize("slope_deg", [0.0, 15.0])
@pytest.mark.parametrize("look_deg", [0.0, 10.0])
def test_a_nearest_return_has_no_attitude_but_its_lever_arm(slope_deg: float, look_deg: float) -> None:
    slope, pitch = np.radians((slope_deg, look_deg))
    predictor, mat_nb = look(pitch, 2.0, KnownReceiver(beam_width=math.radians(70.0), rings=8), slope)
    found, _ = drawn(predictor, mat_nb, np.random.default_rng(4), COV, 1500)
    truth = predictor.predict_local([0.0, 0.0, ABOVE], mat_nb)
    sigma = math.sqrt(range_variance(truth, ErrorModel(COV, 0.0, DEM_SD), nearest=True)[0])
    assert sigma == pytest.approx(np.std(found.slant_range), rel=WITHIN)
    assert sigma < 0.5 * ABOVE * ATTITUDE_SD + 2.5


@pytest.mark.parametrize(("beam_deg", "slope_deg", "look_deg"), WIDE)
def test_range_and_height_of_a_wide_beam_within_5_percent(beam_deg: float, slope_deg: float, look_deg: float) -> None:
    """Inside the beam, and at its edge, where the ray turns with the aircraft: there sigmas were 4 to 29 % small."""
    slope, pitch, n = np.radians(slope_deg), np.radians(look_deg), 2000
    predictor, mat_nb = look(pitch, 2.0, KnownReceiver(beam_width=math.radians(beam_deg), rings=10), slope)
    found, _ = drawn(predictor, mat_nb, np.random.default_rng(4), COV, n)
    truth = predictor.predict_local([0.0, 0.0, ABOVE], mat_nb)
    noise = RANGE_SD * np.random.default_rng(5).standard_normal(n)
    errors = ErrorModel(COV, RANGE_SD, DEM_SD, dem_length=math.inf)
    off = truth.slant_range + noise - found.slant_range
    sigma = math.sqrt(range_variance(truth, errors, nearest=True)[0])
    assert sigma == pytest.approx(np.std(off), rel=WITHIN)
    height = found.height_p + off * found.cosine
    assert math.sqrt(height_variance(truth, errors, nearest=True)[0]) == pytest.approx(np.std(height), rel=WITHIN)


@pytest.mark.parametrize("slope_deg", [0.0, 15.0, 30.0])
@pytest.mark.parametrize("look_deg", [0.0, 15.0, 30.0])
@pytest.mark.parametrize("heading_deg", [0.0, 120.0, 180.0])
@pytest.mark.parametrize("nearest", [False, True])
def test_over_a_plane_the_sampled_variance_is_that_of_the_plane(
    slope_deg: float, look_deg: float, heading_deg: float, nearest: bool
) -> None:
    slope, pitch, heading = np.radians((slope_deg, look_deg, heading_deg))
    sensor = KnownReceiver(beam_width=math.radians(140.0), rings=10) if nearest else LASER
    predictor, mat_nb = look(pitch, heading, sensor, slope)
    prediction = predictor.predict_local([0.0, 0.0, ABOVE], mat_nb)
    errors = ErrorModel(COV, RANGE_SD)
    around = sampled_height_variance(predictor.terrain, prediction, errors, nearest=nearest)[0]
    assert math.sqrt(around) == pytest.approx(
        math.sqrt(height_variance(prediction, errors, nearest=nearest)[0]), rel=WITHIN
    )
    of_range = sampled_range_variance(predictor.terrain, prediction, errors, nearest=nearest)[0]
    assert math.sqrt(of_range) == pytest.approx(
        math.sqrt(range_variance(prediction, errors, nearest=nearest)[0]), rel=WITHIN
    )


def test_beside_a_wall_the_sigma_includes_the_wall() -> None:
    """Level ground 8 m from a step of 20 m, the place known to 10 m.  Straight down, N is M."""
    heights = np.where(np.arange(401)[None, :] * 2.0 - 400.0 > 8.0, 20.0, 0.0) * np.ones((401, 1))
    ground = Terrain.from_array(heights, 2.0, east0=-400.0, north0=-400.0)
    errors = ErrorModel(pose_cov((10.0, 10.0, 2.0), 0.0), 0.1)
    down, aslant = (
        Predictor(ground, LASER).predict_local([0.0, 0.0, 100.0], mat_from_rpy(roll, 0.0, 0.0)) for roll in (0.0, 0.17)
    )
    assert math.sqrt(sampled_height_variance(ground, down, errors, nearest=False)[0]) == pytest.approx(0.1, abs=1e-6)
    assert math.sqrt(height_variance(aslant, errors, nearest=False)[0]) < 0.2
    sigma = math.sqrt(sampled_height_variance(ground, aslant, errors, nearest=False)[0])
    assert sigma == pytest.approx(20.0 * math.sqrt(0.2119), rel=0.2)  # N beyond 0.8 sigma; M, 17 m west, beyond 2.5


def test_beside_a_wall_a_range_is_as_uncertain_as_the_wall_is_high() -> None:
    """Straight down 8 m from a step of 20 m, the place known to 10 m: against all that is drawn of it."""
    heights = np.where(np.arange(401)[None, :] * 2.0 - 400.0 > 8.0, 20.0, 0.0) * np.ones((401, 1))
    ground, cov = Terrain.from_array(heights, 2.0, east0=-400.0, north0=-400.0), pose_cov((10.0, 10.0, 2.0), 0.0)
    prediction = Predictor(ground, LASER).predict_local([0.0, 0.0, 100.0], np.eye(3))
    errors = ErrorModel(cov, 0.1)
    drawn_p = np.array([0.0, 0.0, 100.0]) + np.random.default_rng(8).normal(0.0, [10.0, 10.0, 2.0], (4000, 3))
    off = prediction.slant_range - Predictor(ground, LASER).predict_local(drawn_p, np.eye(3)).slant_range
    sigma = math.sqrt(sampled_range_variance(ground, prediction, errors, nearest=False)[0])
    assert sigma == pytest.approx(float(np.sqrt(np.mean(off**2))), rel=0.1)
    assert math.sqrt(range_variance(prediction, errors, nearest=False)[0]) < 0.25 * sigma


def test_correlated_pose_errors_count() -> None:
    """An error of pitch that goes with one along the track: 3.20 has no term for it."""
    predictor, mat_nb = look(math.radians(-30.0), 0.0, slope=math.radians(20.0))
    cov = COV.copy()
    cov[0, 4] = cov[4, 0] = 0.9 * POSITION_SD * ATTITUDE_SD
    truth = predictor.predict_local([0.0, 0.0, ABOVE], mat_nb)
    found, _ = drawn(predictor, mat_nb, np.random.default_rng(5), cov, 4000)
    together, apart = (
        math.sqrt(range_variance(truth, ErrorModel(c, 0.0, DEM_SD), nearest=False)[0]) for c in (cov, COV)
    )
    assert together == pytest.approx(np.std(found.slant_range), rel=WITHIN)
    assert abs(together / apart - 1.0) > 2.0 * WITHIN


@pytest.mark.parametrize(("slope_deg", "look_deg"), [(0.0, 0.0), (0.0, 30.0), (20.0, 0.0), (20.0, 20.0)])
def test_footprint_within_5_percent(slope_deg: float, look_deg: float) -> None:
    slope, pitch = np.radians((slope_deg, look_deg))
    predictor, mat_nb = look(pitch, 1.0, slope=slope)
    found, dem = drawn(predictor, mat_nb, np.random.default_rng(6), COV, 20_000)
    sigma = footprint_covariance(predictor.predict_local([0.0, 0.0, ABOVE], mat_nb), ErrorModel(COV, 0.0, DEM_SD))[0]
    point_n = np.stack((found.point_l[:, 1], found.point_l[:, 0], -found.point_l[:, 2] - dem), axis=-1)
    sampled = np.cov(point_n.T)
    np.testing.assert_allclose(np.sqrt(np.diag(sigma)), np.sqrt(np.diag(sampled)), rtol=WITHIN, atol=1e-3)
    sd = np.sqrt(np.diag(sigma)) + 1e-9
    np.testing.assert_allclose(sigma / np.outer(sd, sd), sampled / np.outer(sd, sd), atol=0.05)


# ------------------------------------------------------------------------------------------------------- closed forms


def test_level_ground_roll_45_has_1_414_and_not_0_707() -> None:
    """Eq. 3.44 projects where it must divide."""
    prediction = Predictor(sloping(0.0), LASER).predict_local(
        [0.0, 0.0, ABOVE], mat_from_rpy(math.radians(45.0), 0.0, 0.0)
    )
    assert range_row(prediction, nearest=False)[0, 2] == pytest.approx(-math.sqrt(2.0), rel=1e-9)
    higher = Predictor(sloping(0.0), LASER).predict_local(
        [0.0, 0.0, ABOVE + 1.0], mat_from_rpy(math.radians(45.0), 0.0, 0.0)
    )
    assert higher.slant_range[0] - prediction.slant_range[0] == pytest.approx(math.sqrt(2.0), rel=1e-9)


def test_slope_20_look_30_is_1_755_m() -> None:
    """P known to 1 m on each axis, elevation to 1.5 m; looking up the slope n . u is cos(10 deg)."""
    predictor, mat_nb = look(math.radians(30.0), 0.0, slope=math.radians(20.0))
    errors = ErrorModel(pose_cov(1.0, 0.0), 0.0, DEM_SD)
    prediction = predictor.predict_local([0.0, 0.0, ABOVE], mat_nb)
    assert math.sqrt(range_variance(prediction, errors, nearest=False)[0]) == pytest.approx(1.755, abs=5e-4)


def test_the_printed_difference_of_covariances_is_negative() -> None:
    """Eq. 3.20 with a footprint as uncertain as P: Cov x(M) - Cov x(P) = 0, and less where P is the worse one."""
    prediction = Predictor(sloping(0.0), LASER).predict_local([0.0, 0.0, ABOVE], np.eye(3))
    u, position, footprint = prediction.direction_n[0], COV[:3, :3], np.eye(3) * 0.5**2
    assert u @ footprint @ u - u @ position @ u < 0.0
    assert range_variance(prediction, ErrorModel(COV, 0.0, 0.5), nearest=False)[0] == pytest.approx(
        1.0**2 + 0.5**2, rel=1e-9
    )


@pytest.mark.parametrize("roll_deg", [0.0, 20.0, 45.0])
def test_over_level_ground_the_height_does_not_depend_on_p(roll_deg: float) -> None:
    prediction = Predictor(sloping(0.0), LASER).predict_local(
        [0.0, 0.0, ABOVE], mat_from_rpy(math.radians(roll_deg), 0.0, 0.0)
    )
    errors = ErrorModel(pose_cov(POSITION_SD, 0.0))
    assert height_variance(prediction, errors, nearest=False)[0] == pytest.approx(0.0, abs=1e-12)
    assert range_row(prediction, nearest=False)[0, 2] * prediction.cosine[0] == pytest.approx(-1.0, rel=1e-12)


def test_errors_of_the_elevation_far_apart_do_not_cancel() -> None:
    """Level ground, M 173 m beside N: the nadir's error and the footprint's, with correlation exp(-1.73) between."""
    prediction = Predictor(sloping(0.0), LASER).predict_local(
        [0.0, 0.0, ABOVE], mat_from_rpy(math.radians(30.0), 0.0, 0.0)
    )
    far = height_variance(prediction, ErrorModel(dem_sd=DEM_SD, dem_length=100.0), nearest=False)[0]
    assert far == pytest.approx(2.0 * DEM_SD**2 * (1.0 - math.exp(-3.0 * math.tan(math.radians(30.0)))), rel=1e-9)


def test_what_is_not_predicted_has_no_variance() -> None:
    prediction = Predictor(sloping(0.0), LASER).predict_local([[0.0, 0.0, ABOVE], [math.nan, 0.0, 1.0]], np.eye(3))
    errors = ErrorModel(COV, 0.1)
    around = sampled_height_variance(sloping(0.0), prediction, errors, nearest=False)
    for variance in (range_variance(prediction, errors, nearest=False), around):
        assert np.isfinite(variance[0])
        assert np.isnan(variance[1])


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_covariance_that_is_no_number_gives_none(bad: float) -> None:
    prediction = Predictor(sloping(0.0), LASER).predict_local([0.0, 0.0, ABOVE], np.eye(3))
    errors = ErrorModel(np.where(COV > 0.0, bad, 0.0), 0.1)
    assert not np.isfinite(sampled_height_variance(sloping(0.0), prediction, errors, nearest=False)[0])
    with np.errstate(invalid="ignore"):
        assert not np.isfinite(range_variance(prediction, errors, nearest=False)[0])
