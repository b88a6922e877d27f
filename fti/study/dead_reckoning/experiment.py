"""Flights without satellites through the filter, with drifts between looks in several forms of aiding, and without."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.geodesy.formulas import ecef_from_geodetic, metres_per_radian
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.hil.sensors.imu import Imu
from fti.hil.sensors.imu_grades import GRADES, GradeName
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.nav.filter.aiding import BaroAltitude, GnssPosition, GnssVelocity
from fti.nav.filter.error_states import BARO_DRIFT, BARO_SCALE_DRIFT, GNSS_DRIFTS, Extra, outage_model
from fti.nav.filter.estimate import Estimate, InitialState
from fti.nav.filter.look_mark import LookDrift, LookMark, look_drifts
from fti.nav.filter.navigator import InertialNavigator
from fti.nav.inertial.ins_error_model import IMU_ERROR_MODELS
from fti.nav.look_pairs import LookPairs, RangeImage
from fti.study.dead_reckoning.exact_looks import ExactPairs, TruePose
from fti.study.dead_reckoning.flight import (
    AID_S,
    IMAGE_S,
    IMU_S,
    OUTAGE_S,
    PATHS,
    RANGE_SD,
    SATELLITE_SD,
    SECONDS,
    VELOCITY_SD,
    Aids,
    Images,
    draw_aids,
    draw_images,
    ground,
    route,
)
from fti.study.dead_reckoning.printed_forms import FORMS

#: Flights over one ground.
RUNS_PER_GROUND = 5
#: Looks from the first of a pair to the second: 1 s, where overlap times interval is largest (T18).
SPACING = 2
#: Looks begin when the filter is aligned [s].
LOOKS_FROM_S = 20.0
#: Sigma of the first state: position [m], velocity [m/s], roll and pitch, heading [rad].
START_SD = (3.0, 0.3, 0.003, 0.02)
#: Grades; one flight in so many has the navigation grade, and one in so many of the tactical unit the printed forms.
UNITS: tuple[GradeName, ...] = ("tactical", "mems", "navigation")
NAVIGATION_EVERY, FORMS_EVERY = 5, 10
#: Time without satellites of the ten instants at which errors are compared with their sigma [s].
INSTANTS_S = tuple(np.linspace(50.0, 500.0, 10))


@dataclass(frozen=True, eq=False)
class Track:
    """Of the filter, every second from the start of the outage on.

    t     : (n,) [s] since then
    error : (n, 2) [m]   along the track of that second and across, computed minus true
    ratio : (n, 2)       error over sigma, north and east; both are infinite where the filter has no position
    pairs : numbers of pairs by measured directions ("3", "2", ...) and refusal
    heading_sd : sigma of the heading at the start of the outage [rad]
    pair_sd    : median of the horizontal sigmas of the pairs with three directions [m]; NaN without looks
    """

    t: Array
    error: Array
    ratio: Array
    pairs: Counter[str]
    heading_sd: float
    pair_sd: float

    @property
    def end(self) -> Array:
        """Error at the end, along and across [m]."""
        return np.asarray(self.error[-1])


#: The tracks of one flight by path, unit and aid: none, exact, looks, or one of the printed forms.
Tracks = dict[tuple[str, str, str], Track]


def run(task: tuple[int, int]) -> Tracks:
    """Flight ``number`` of a seed with each unit and aid: straight for even numbers."""
    seed, number = task
    path = PATHS[number % len(PATHS)]
    tracks: Tracks = {}
    for unit in UNITS:
        if unit == "navigation" and number // len(PATHS) % NAVIGATION_EVERY:
            continue
        with_forms = unit == "tactical" and number // len(PATHS) % FORMS_EVERY == 0
        for aid in ("none", "exact", "looks", *(FORMS if with_forms else ())):
            tracks[path, unit, aid] = fly(path, unit, aid, seed, number)
    return tracks


@dataclass(frozen=True, eq=False)
class FlightData:
    """What the sensors of one flight measure, but for the inertial unit; truth at its samples.

    t, course : (n,) [s, rad];  truth : (n, 3) latitude, longitude [rad], altitude [m];  rpy : (n, 3) [rad]
    draw_images : called once, after ``aids`` is drawn from the same random numbers
    """

    t: Array
    truth: Array
    rpy: Array
    course: Array
    force_b: Array
    rate_b: Array
    start: InitialState
    aids: Aids
    draw_images: Callable[[], Images]

    @functools.cached_property
    def images(self) -> Images:
        """Those of the imager: without looks they are not drawn."""
        return self.draw_images()

    def true_pose(self, k: int) -> TruePose:
        """At a sample."""
        lat, lon, alt = self.truth[k].tolist()
        x_e = np.array(ecef_from_geodetic(lat, lon, alt))
        to_e = mat_en(lat, lon)
        return TruePose(x_e, to_e @ mat_from_rpy(*self.rpy[k]), to_e[:, 2])


@functools.lru_cache(maxsize=1)
def draw_flight(path: str, seed: int, number: int) -> FlightData:
    """Flight ``number`` of a seed."""
    rng = np.random.default_rng([seed, number])
    terrain = ground(path, number // RUNS_PER_GROUND)
    flight = route(terrain, path, rng)
    t = np.arange(0.0, SECONDS + IMU_S / 2, IMU_S)
    truth = flight.state(t)
    pos, vel, tilt, turn = START_SD
    per_lat, per_lon = metres_per_radian(float(truth.lat[0]), float(truth.alt[0]))
    offset = rng.standard_normal(9)
    start = InitialState(
        float(truth.lat[0]) + pos * offset[0] / per_lat, float(truth.lon[0]) + pos * offset[1] / per_lon,
        float(truth.alt[0]) + pos * offset[2], tuple((truth.vel_n[0] + vel * offset[3:6]).tolist()),
        float(truth.roll[0]) + tilt * offset[6], float(truth.pitch[0]) + tilt * offset[7],
        float(truth.heading[0]) + turn * offset[8], (pos,) * 3, (vel,) * 3, (tilt, tilt, turn),
    )  # fmt: skip
    places = np.stack((truth.lat, truth.lon, truth.alt), axis=1)
    rpy = np.stack((truth.roll, truth.pitch, truth.heading), axis=1)
    course = np.arctan2(truth.vel_n[:, 1], truth.vel_n[:, 0])
    return FlightData(
        t, places, rpy, course, specific_force_b(truth), angular_rate_b(truth), start,
        draw_aids(flight, rng), functools.partial(draw_images, terrain, flight, rng),
    )  # fmt: skip


def fly(path: str, unit: GradeName, aid: str, seed: int, number: int) -> Track:
    """One flight with a grade of the inertial unit and an aid."""
    data = draw_flight(path, seed, number)
    rng = np.random.default_rng([seed, number, len(unit)])
    force_b, rate_b = Imu(GRADES[unit], rng).measure(data.t, data.force_b, data.rate_b)
    run = _Run(data, unit, aid)
    run.navigator.begin(-1, data.start, force_b[0], rate_b[0])
    for k, t in enumerate(data.t.tolist()):
        t_ns = round(t * SECOND_NS)
        run.navigator.feed_inertial(t_ns, force_b[k].tolist(), rate_b[k].tolist())
        if k and k % round(AID_S / IMU_S) == 0:
            run.feed_aids(k // round(AID_S / IMU_S) - 1, t_ns)
        if aid != "none" and t >= LOOKS_FROM_S and k % round(IMAGE_S / IMU_S) == 0:
            run.feed_look(k, t_ns)
        if t >= OUTAGE_S and k % round(1.0 / IMU_S) == 0:
            run.observe(k, t_ns)
    return run.track()


class _Run:
    """The filter of a flight and what is observed of it."""

    def __init__(self, data: FlightData, unit: str, aid: str) -> None:
        self.data, self.aid = data, aid
        self._pairs, self._exact_pairs = LookPairs(SPACING), ExactPairs(SPACING)
        extras = {**GNSS_DRIFTS, Extra.BARO: BARO_DRIFT, Extra.BARO_SCALE: BARO_SCALE_DRIFT}
        if aid != "none":
            extras |= look_drifts(self._pairs.slots)
        self.navigator = InertialNavigator(outage_model(IMU_ERROR_MODELS[unit], extras))
        self._counts: Counter[str] = Counter()
        self._rows: list[tuple[float, ...]] = []
        self._pair_sds: list[float] = []
        self._heading_sd = np.nan

    def feed_aids(self, k: int, t_ns: int) -> None:
        """Satellites until the outage, and the barometer."""
        aids, truth = self.data.aids, self.data.aids.truth
        if k >= len(aids.t):
            return
        self.navigator.feed_aiding(t_ns, BaroAltitude(float(aids.pressure[k]), 1.0))
        if aids.t[k] >= OUTAGE_S:
            return
        per_lat, per_lon = metres_per_radian(float(truth.lat[k]), float(truth.alt[k]))
        north, east, down = aids.offsets[k].tolist()
        lat, lon, alt = truth.lat[k] + north / per_lat, truth.lon[k] + east / per_lon, truth.alt[k] - down
        self.navigator.feed_aiding(t_ns, GnssPosition(float(lat), float(lon), float(alt), *SATELLITE_SD))
        vel_north, vel_east, vel_down = aids.vel_n[k].tolist()
        self.navigator.feed_aiding(t_ns, GnssVelocity(vel_north, vel_east, vel_down, VELOCITY_SD))

    def feed_look(self, k: int, t_ns: int) -> None:
        """A look at sample ``k``, and the drift since the first one of its pair."""
        estimate = self.navigator.at(t_ns)
        if estimate is None or t_ns >= SECONDS * SECOND_NS:
            return
        mark, drift = self._compare_exactly(estimate, k) if self.aid == "exact" else self._compare_images(estimate, k)
        if drift is not None and self.aid in {"exact", "looks"}:
            self.navigator.feed_aiding(t_ns, drift)
        elif drift is not None and t_ns >= OUTAGE_S * SECOND_NS:
            self.navigator.feed_aiding(t_ns, FORMS[self.aid](drift, SPACING * IMAGE_S))
        self.navigator.feed_aiding(t_ns, mark)

    def _compare_exactly(self, estimate: Estimate, k: int) -> tuple[LookMark, LookDrift | None]:
        mark, drift = self._exact_pairs.feed(estimate, self.data.true_pose(k))
        if drift is not None:
            self._count(3, drift.cov)
        return mark, drift

    def _compare_images(self, estimate: Estimate, k: int) -> tuple[LookMark, LookDrift | None]:
        images = self.data.images
        ranges = images.ranges[k // round(IMAGE_S / IMU_S) - 1]
        result = self._pairs.feed(estimate, [RangeImage(ranges, images.directions_b, RANGE_SD)])
        if result.drift is not None:
            self._count(len(result.drift.axes_l), result.drift.cov)
            self._counts.update(result.drift.refusals)
        return result.mark, result.aiding

    def _count(self, directions: int, cov: Array) -> None:
        """Count a pair with its measured directions and its covariance [m^2]."""
        self._counts[str(directions)] += 1
        if directions == 3:
            self._pair_sds += np.sqrt(np.diag(cov)[:2]).tolist()

    def observe(self, k: int, t_ns: int) -> None:
        """Error and sigma; infinite where the filter has no position."""
        estimate = self.navigator.at(t_ns)
        if estimate is None:
            self._rows.append((t_ns / SECOND_NS - OUTAGE_S, *[np.inf] * 4))
            return
        lat, lon, alt = self.data.truth[k].tolist()
        per_lat, per_lon = metres_per_radian(lat, alt)
        north, east = (estimate.geodetic[0] - lat) * per_lat, (estimate.geodetic[1] - lon) * per_lon
        course = self.data.course[k]
        along = north * np.cos(course) + east * np.sin(course)
        across = east * np.cos(course) - north * np.sin(course)
        sd = estimate.sd_n
        if np.isnan(self._heading_sd):
            self._heading_sd = estimate.rpy_sd[2]
        self._rows.append((t_ns / SECOND_NS - OUTAGE_S, along, across, north / sd[0], east / sd[1]))

    def track(self) -> Track:
        """What was observed."""
        rows = np.array(self._rows)
        pair_sd = float(np.median(self._pair_sds)) if self._pair_sds else np.nan
        return Track(rows[:, 0], rows[:, 1:3], rows[:, 3:5], self._counts, self._heading_sd, pair_sd)
