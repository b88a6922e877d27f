"""What every ranging sensor of the package promises, tried on each of them with its default parameters.

A new sensor is found by itself.  Where it measures the nearest point, not along a ray, ``FOLLOW_THE_NEAREST`` says so.
"""

import functools
import importlib
import inspect
import pkgutil
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import fti.ranging
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.error_model import RangeError
from fti.ranging.imager import RangeImager
from fti.ranging.laser import Laser
from fti.ranging.scanner import RangeScanner
from fti.ranging.sensor import Poses, RangingSensor, Returns, Validity
from fti.ranging.weather import Cloud
from fti.terrain.terrain import Terrain
from tests.planes import HALF_M, looking_down, plane

Array = NDArray[np.float64]

FLAT = plane()
HEIGHT = 300.0


def found_sensors() -> list[type[RangingSensor]]:
    """Every class in the package that can be made."""
    for module in pkgutil.walk_packages(fti.ranging.__path__, "fti.ranging."):
        importlib.import_module(module.name)
    classes, todo = set(), [RangingSensor]
    while todo:
        todo += (below := todo.pop().__subclasses__())
        classes |= {one for one in below if one.__module__.startswith("fti.") and not inspect.isabstract(one)}
    return sorted(classes, key=lambda one: one.__qualname__)


SENSORS = found_sensors()
#: A pulse with everything that can be asked of it; the fog lies below all heights that are flown here.
FULL = Laser(
    500.0,
    reflectance=0.2,
    pulse_length=10e-9,
    divergence=2e-3,
    returns="both",
    weather=(Cloud(-np.inf, 5.0, 1e-3, variation=0.5),),
    error=RangeError(bias=0.0, noise_sd=0.05),
    sentinel=130.0,
)
MAKES: dict[str, Callable[[], RangingSensor]] = {kind.__name__: kind for kind in SENSORS} | {
    "Laser, in full": lambda: FULL,
    "RangeScanner, in full": lambda: RangeScanner(FULL, facets=9),
    "RangeImager, in full": lambda: RangeImager(FULL, pixels=(9, 5)),
}
each = pytest.mark.parametrize("name", MAKES)


@functools.cache
def make(name: str) -> RangingSensor:
    try:
        return MAKES[name]()
    except TypeError as error:
        pytest.fail(f"{name} cannot be made without parameters; give it those of a make: {error}")


#: These measure the height over level ground, whatever direction the power came from; and how far off they may be [m].
FOLLOW_THE_NEAREST = {
    "NearestReturn": 1e-3,  # 0.6 mm at 300 m, its module says
    "RadarAltimeter": 0.5,  # one range bin
    "InterferometricAltimeter": 1e-3,  # what its search leaves in the mean
}


def level_error(sensor: RangingSensor, returns: Returns) -> tuple[float, float]:
    """How far ranges over level ground are from d = h / cos (eq. 2.67), and how far they may be [m]."""
    name = type(sensor).__name__
    cosine = np.ones_like(returns.slant_range) if name in FOLLOW_THE_NEAREST else returns.direction_s[..., 2]
    error = float(np.abs(returns.slant_range * cosine - HEIGHT)[returns.valid].max())
    wide = getattr(getattr(sensor, "laser", sensor), "divergence", 0.0) > 0.0  # the mean of 19 rays is a little longer
    return error, FOLLOW_THE_NEAREST.get(name, (1e-5 if wide else 1e-9) * HEIGHT)


def check_returns(sensor: RangingSensor, returns: Returns, poses: int) -> None:
    """Shapes and values as ``Returns`` describes them."""
    name, shape = type(sensor).__name__, returns.slant_range.shape
    assert len(shape) >= 1 and shape[0] == poses, f"{name}: slant_range has the shape {shape} for {poses} poses"
    assert returns.direction_s.shape == (*shape, 3), f"{name}: direction_s has the shape {returns.direction_s.shape}"
    for part in ("dispersion", "power", "validity"):
        assert getattr(returns, part).shape == shape, f"{name}: {part} has another shape than slant_range, {shape}"
    assert returns.validity.dtype == np.uint8, f"{name}: validity is {returns.validity.dtype}, must be uint8"
    assert np.isin(returns.validity, list(Validity)).all(), f"{name}: a validity that is none"
    valid, sentinel = returns.valid, getattr(getattr(sensor, "laser", sensor), "sentinel", None)
    assert np.isfinite(returns.slant_range[valid]).all(), f"{name}: valid, but no range"
    lengths = np.linalg.norm(returns.direction_s[valid], axis=-1)
    assert np.abs(lengths - 1.0).max(initial=0.0) < 1e-9, f"{name}: valid, but direction_s is no unit vector"
    silent = np.isnan(returns.slant_range[~valid]) | (returns.slant_range[~valid] == sentinel)
    assert silent.all(), f"{name}: not valid, but a range"
    assert np.isnan(returns.direction_s[~valid]).all(), f"{name}: not valid, but a direction"
    assert not (returns.dispersion < 0.0).any() and not (returns.power < 0.0).any(), f"{name}: negative spread or power"


def same_bytes(one: Returns, other: Returns) -> bool:
    names = ("slant_range", "direction_s", "dispersion", "power", "validity")
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in names)


def flight_poses(poses: int = 8) -> Poses:
    rng = np.random.default_rng(11)
    roll, pitch = rng.uniform(-0.3, 0.3, (2, poses))
    at = looking_down(rng.uniform(100.0, 500.0, poses), roll, pitch, rng.uniform(0.0, 6.0, poses))
    return Poses(at.origins_l, at.mats_ls, rng.uniform(-50.0, 50.0, (poses, 3)))


def rough() -> Terrain:
    return FLAT.with_finest(np.random.default_rng(12).normal(0.0, 10.0, FLAT.finest.heights.shape))


def holed() -> Terrain:
    """Nothing is known for 600 m around the origin, and beyond 1000 m all is."""
    layer = FLAT.finest
    inside = (np.abs(layer.east)[None, :] < 600.0) & (np.abs(layer.north)[:, None] < 600.0)
    return FLAT.with_finest(np.where(inside, np.nan, layer.heights))


def reasons(name: str, terrain: Terrain, poses: Poses) -> set[Validity]:
    returns = make(name).measure(terrain, poses)
    check_returns(make(name), returns, len(poses))
    return {Validity(number) for number in np.unique(returns.validity)}


def test_the_sensors_are_found() -> None:
    names = {kind.__name__ for kind in SENSORS}
    assert {"Laser", "RangeScanner", "RangeImager", "NearestReturn", "RadarAltimeter"} <= names


@each
def test_returns_have_the_shapes_and_values_that_are_promised(name: str) -> None:
    sensor = make(name)
    for poses in (flight_poses(), flight_poses(1), flight_poses(0)):
        check_returns(sensor, sensor.measure(rough(), poses), len(poses))
        check_returns(sensor, sensor.measure(rough(), poses, np.random.default_rng(1)), len(poses))


@each
def test_level_ground_has_the_closed_form(name: str) -> None:
    sensor = make(name)
    at = looking_down(np.full(3, HEIGHT), heading=[0.0, 1.0, 2.5])
    returns = sensor.measure(FLAT, at)
    assert returns.valid.mean() > 0.9, f"{name} has no range {HEIGHT} m over level ground: {returns.validity}"
    error, allowed = level_error(sensor, returns)
    assert error <= allowed, f"{name} is {error:.3g} m off over level ground; {allowed:.3g} m are allowed"


@each
@pytest.mark.parametrize("lost", ["origins_l", "mats_ls"])
def test_a_pose_that_is_no_number_is_unknown(name: str, lost: str) -> None:
    at = looking_down([HEIGHT, HEIGHT])
    getattr(at, lost)[:] = np.nan
    assert reasons(name, FLAT, at) == {Validity.UNKNOWN}


@each
def test_a_lost_pose_leaves_its_neighbours_alone(name: str) -> None:
    at, sensor = flight_poses(), make(name)
    whole = sensor.measure(rough(), at)
    at.origins_l[4] = np.nan
    found = sensor.measure(rough(), at)
    others = np.arange(len(at)) != 4
    assert (found.validity[4] == Validity.UNKNOWN).all()
    assert found.slant_range[others].tobytes() == whole.slant_range[others].tobytes()


@each
def test_underground_is_buried(name: str) -> None:
    assert reasons(name, FLAT, looking_down([-3.0, -100.0])) == {Validity.BURIED}


@each
def test_beside_the_coverage_is_outside(name: str) -> None:
    at = looking_down([HEIGHT, 50.0])
    at.origins_l[:, 0] = 3.0 * HALF_M
    assert reasons(name, FLAT, at) == {Validity.OUTSIDE}


@each
def test_over_a_hole_nothing_is_known(name: str) -> None:
    assert reasons(name, holed(), looking_down([200.0, 300.0])) == {Validity.HOLE}


@each
def test_upside_down_there_is_no_ground(name: str) -> None:
    """Towards the sky a ray ends nowhere, or leaves the coverage."""
    assert reasons(name, FLAT, looking_down([HEIGHT, 50.0], np.pi)) <= {Validity.NO_RETURN, Validity.OUTSIDE}


@each
def test_the_same_generator_gives_the_same_bytes(name: str) -> None:
    at, sensor, ground = flight_poses(), make(name), rough()
    first, again = (sensor.measure(ground, at, np.random.default_rng(3)) for _ in range(2))
    assert same_bytes(first, again), f"{name}: the same seed gave something else"
    before = np.random.get_state()[1].tobytes()  # type: ignore[index]
    quiet, again = sensor.measure(ground, at), make(name).measure(ground, at)
    assert same_bytes(quiet, again), f"{name} is random without a generator"
    assert np.random.get_state()[1].tobytes() == before, f"{name} draws from numpy's global generator"  # type: ignore[index]


@each
def test_poses_do_not_know_of_each_other(name: str) -> None:
    """Without noise, many at once are what each is alone."""
    at, sensor, ground = flight_poses(), make(name), rough()
    together = sensor.measure(ground, at)
    for k in (0, 7):
        one = sensor.measure(ground, Poses(at.origins_l[k : k + 1], at.mats_ls[k : k + 1], at.vels_l[k : k + 1]))
        assert one.slant_range[0] == pytest.approx(together.slant_range[k], rel=1e-12, nan_ok=True)
        assert (one.validity[0] == together.validity[k]).all()


anywhere = st.floats(-3.0 * HALF_M, 3.0 * HALF_M) | st.sampled_from([0.0, HALF_M, -HALF_M, np.nan, np.inf, -np.inf])
any_angle = st.floats(-np.pi, np.pi) | st.sampled_from([0.0, np.pi / 2, np.pi, np.nan])
any_height = st.floats(-500.0, 3000.0) | st.sampled_from([0.0, 1e-9, 1e6, np.nan, np.inf])


@each
@settings(max_examples=8)
@given(st.lists(st.tuples(anywhere, anywhere, any_height, any_angle, any_angle), min_size=1, max_size=4))
def test_strange_poses_get_an_answer_or_a_reason(
    name: str, strange: list[tuple[float, float, float, float, float]]
) -> None:
    columns = np.array(strange)
    with np.errstate(invalid="ignore"):
        mats = MAT_ENU_NED @ mat_from_rpy(columns[:, 3], columns[:, 4], 0.3)
    sensor, at = make(name), Poses.stationary(columns[:, :3], mats)
    for ground in (FLAT, holed()):
        check_returns(sensor, sensor.measure(ground, at, np.random.default_rng(0)), len(at))
