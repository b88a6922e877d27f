"""The compiled form for one pose says what the arrays of poses say; and the channel says why it cannot."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from fti.config import Altimeter, Device
from fti.geodesy.rotations import mat_from_rpy
from fti.messages.reasons import Reason
from fti.nav.altimetry.expected_range import HEADING_SD, AltimeterPredictor, warm_up
from fti.nav.altimetry.expected_sample import ExpectedSample, ExpectedSampleOrReason, NoGround
from fti.nav.altimetry.nadir_height import ground_sd
from fti.nav.altimetry.range_prediction import Prediction, Predictor
from fti.nav.altimetry.variance import ErrorModel, pose_cov, sampled_height_variance, sampled_range_variance
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import AttitudeState, PositionState
from fti.nav.terrain_reference import Ground
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.radar.single_pose import SinglePoseRadar
from fti.ranging.sensor import RangingSensor
from fti.terrain.terrain import Terrain

LAT, LON = 0.84, 0.19
LEVER, MOUNTED_DEG = (-1.2, 0.3, 0.6), (2.0, -3.0, 10.0)
FLAT_SD, HIGH_SD, TILT_SD, RANGE_SD, DEM_SD = 3.0, 2.0, 0.008, 0.3, 1.5


@pytest.fixture(scope="module")
def ground() -> Ground:
    """Hills of 60 m, 12 km wide, with a wall; its frame lies at LAT, LON."""
    posts = np.arange(-600, 601) * 10.0
    east, north = np.meshgrid(posts, posts)
    hills = 300.0 + 30.0 * np.sin(east / 90.0) + 30.0 * np.cos(north / 70.0 + east / 400.0)
    hills[(np.abs(east - 100.0) < 40.0)] += 25.0
    terrain = Terrain.from_array(hills, 10.0, lat0=LAT, lon0=LON, east0=-6000.0, north0=-6000.0)
    return Ground(terrain, DEM_SD, "hills")


def device(kind: str, model: str = "nearest") -> Device:
    altimeter = Altimeter.model_validate({"kind": kind, "range_m": (0.5, 700.0), "model": model})
    return Device(name="a", link="l", driver="d", altimeter=altimeter, lever_arm_b=LEVER, rpy_bs_deg=MOUNTED_DEG)


SENSORS: dict[tuple[str, str], RangingSensor] = {
    ("laser", "nearest"): Laser(max_range=1050.0),
    ("radar", "nearest"): NearestReturn(max_range=1050.0),
    ("radar", "beam"): RadarAltimeter(antenna=cosine_antenna(*[math.radians(40.0)] * 2), max_range=700.0),
}


def poses(n: int) -> list[NavState]:
    rng = np.random.default_rng(7)
    found = []
    for north, east, up in rng.uniform((-3000, -3000, 420), (3000, 3000, 650), (n, 3)):
        lat, lon = LAT + north / 6.37e6, LON + east / (6.37e6 * math.cos(LAT))
        roll, pitch, heading = rng.uniform((-0.5, -0.3, 0.0), (0.5, 0.3, 6.28))
        attitude = AttitudeState(roll, pitch, heading, TILT_SD, TILT_SD / 2)
        found.append(
            NavState(0, attitude, PositionState(lat, lon, up, FLAT_SD, HIGH_SD, 40.0, -30.0, 2.0, 0), "a", "a")
        )
    return found


def by_arrays(sensor: RangingSensor, ground: Ground, nav: NavState) -> Prediction:
    p, a = nav.position, nav.attitude
    assert p is not None
    assert a is not None
    assert p.alt is not None
    mat_bs = mat_from_rpy(*np.radians(MOUNTED_DEG))
    return Predictor(ground.terrain, sensor, LEVER, mat_bs).at(
        p.lat, p.lon, p.alt, a.roll, a.pitch, a.heading or 0.0, (p.north or 0.0, p.east or 0.0, p.down or 0.0)
    )


@pytest.mark.parametrize(("kind", "model"), list(SENSORS))
def test_one_pose_gives_the_result_of_the_arrays(ground: Ground, kind: str, model: str) -> None:
    predictor = AltimeterPredictor(device(kind, model), ground)
    errors = ErrorModel(pose_cov((FLAT_SD, FLAT_SD, HIGH_SD), (TILT_SD, TILT_SD, HEADING_SD)), RANGE_SD, DEM_SD)
    n_expected = 0
    for nav in poses(12):
        there, here = by_arrays(SENSORS[kind, model], ground, nav), predictor.predict(nav, RANGE_SD)
        assert isinstance(here, ExpectedSample) == bool(there.valid[0])
        if not isinstance(here, ExpectedSample):
            continue
        n_expected += 1
        assert nav.position is not None
        place = ground.terrain.frame.to_local(nav.position.lat, nav.position.lon, nav.position.alt or 0.0)
        nearest = kind == "radar"
        pairs = [
            (here.slant_range, there.slant_range, 1e-6),
            (here.height, there.height_p, 1e-6),
            (here.cosine, there.cosine, 1e-9),
            (here.incidence, there.incidence, 1e-6),
            (here.dispersion, there.dispersion, 1e-6),
            (here.range_sd, np.sqrt(sampled_range_variance(ground.terrain, there, errors, nearest=nearest)), 1e-6),
            (here.height_sd, np.sqrt(sampled_height_variance(ground.terrain, there, errors, nearest=nearest)), 1e-6),
            (here.ground_sd, ground_sd(ground.terrain, place, FLAT_SD), 1e-6),
        ]
        for mine, theirs, within in pairs:
            assert mine == pytest.approx(float(theirs[0]), abs=within)
    assert n_expected >= 8


@pytest.mark.parametrize(("kind", "model"), list(SENSORS))
def test_bias_and_scale_of_an_altimeter_are_expected_of_it(ground: Ground, kind: str, model: str) -> None:
    """Only the range changes; values of the ray, the ground and the position stay the same."""
    bare = device(kind, model)
    assert bare.altimeter is not None
    wrong = bare.altimeter.model_copy(update={"bias_m": 2.0, "scale": 1.01})
    biased = AltimeterPredictor(bare.model_copy(update={"altimeter": wrong}), ground)
    for nav in poses(6):
        there, here = AltimeterPredictor(bare, ground).predict(nav, RANGE_SD), biased.predict(nav, RANGE_SD)
        if isinstance(there, ExpectedSample) and isinstance(here, ExpectedSample):
            assert here.slant_range == pytest.approx(1.01 * there.slant_range + 2.0)
            assert dataclasses.replace(here, slant_range=there.slant_range) == there


def test_the_threshold_of_the_leading_edge_is_that_of_the_configuration(ground: Ground) -> None:
    """A lower threshold detects the ground earlier, never later."""
    bare = device("radar", "beam")
    assert bare.altimeter is not None
    found = []
    for level in (None, -6.0206, -20.0):
        altimeter = bare.altimeter.model_copy(update={"threshold_db": level})
        one = AltimeterPredictor(bare.model_copy(update={"altimeter": altimeter}), ground)
        found.append(
            [
                e.slant_range if isinstance(e := one.predict(nav, RANGE_SD), ExpectedSample) else math.nan
                for nav in poses(12)
            ]
        )
    default, quarter, deep = np.array(found)
    assert np.nanmax(np.abs(default - quarter)) < 1e-3
    assert np.nanmax(deep - default) < 0.5
    assert np.nanmean(default - deep) > 1.0


def test_the_reason_for_a_missing_prediction_is_returned(ground: Ground) -> None:
    predictor = AltimeterPredictor(device("laser"), ground)
    level = AttitudeState(0.0, 0.0, 0.0, None, None)

    def predict(
        attitude: AttitudeState | None, lat: float | None = None, lon: float = 0.0, alt: float | None = None
    ) -> ExpectedSampleOrReason:
        position = None if lat is None else PositionState(lat, lon, alt, None, None, None, None, None, 0)
        return predictor.predict(NavState(0, attitude, position, None, None), None)

    assert isinstance(predict(level, LAT, LON, 500.0), ExpectedSample)
    assert predict(level) is Reason.NO_POSITION
    assert predict(None, LAT, LON, 500.0) is Reason.NO_ATTITUDE
    assert predict(level, LAT, LON, None) is Reason.NO_ALTITUDE
    assert predict(AttitudeState(0.0, 0.0, None, None, None), LAT, LON, 500.0) is Reason.NO_HEADING
    assert predict(level, LAT + 0.01, LON, 500.0) is Reason.TERRAIN_EDGE
    assert predict(level, LAT, LON, 100.0) is Reason.HEIGHT_ERROR  # below the ground
    assert isinstance(predict(level, LAT, LON, 9000.0), NoGround)
    for nothing in (math.nan, math.inf, 1e300):
        assert predict(level, LAT, LON, nothing) is Reason.NO_ALTITUDE
        assert isinstance(predict(level, nothing, LON, 500.0), Reason)
    for lat in (math.pi / 2, -math.pi / 2):
        assert isinstance(predict(level, lat, math.pi, 500.0), Reason)
    straight_up = predict(AttitudeState(0.0, math.pi / 2, 1.0, None, None), LAT, LON, 500.0)
    assert not isinstance(straight_up, ExpectedSample) or math.isfinite(straight_up.slant_range)


def test_warm_up_compiles_single_poses_and_arrays(ground: Ground, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both paths are compiled before the flight; the arrays serve the cases that are not ordinary."""
    calls: list[str] = []

    def watch(owner: type, name: str) -> None:
        real = getattr(owner, name)

        def spy(self: Any, *args: Any) -> Any:
            calls.append(name)
            return real(self, *args)

        monkeypatch.setattr(owner, name, spy)

    watch(SinglePoseRadar, "_evaluate")
    watch(RadarAltimeter, "measure")
    warm_up(device("radar", "beam"), ground)
    assert calls == ["_evaluate", "measure"]
