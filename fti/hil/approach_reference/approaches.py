"""Simulated nominal approaches for the calibration of the integrity monitor, faster than real time.

No bytes and no links: arrays of altimeter heights and navigation are the input of the monitor.  ``Spread`` has the
variation between flights; every varying error is a first-order Gauss-Markov process.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fti.arrays import Array
from fti.hil.approach_reference.receivers import ReceiverVariant, measure
from fti.hil.sensors.errors import gauss_markov_noise, white_noise
from fti.messages.outputs import ClearanceIntegrity
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.monitor import ClearanceMonitor, ClearanceSample
from fti.nav.integrity.reference import ReferenceSensor
from fti.nav.integrity.window import ClearanceSeries
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn
from fti.ranging.radar.altimeter import quantisation_steps
from fti.ranging.sensor import Poses, sensor_poses
from fti.terrain.terrain import Terrain

START_NS = 1_000_000_000
#: Height errors decrease linearly within this distance to go [m].
TAPER_M = 1000.0
#: Minimum height above the plane of the runway [m].
FLARE_M = 3.0
#: Share of the sigma of the navigated height that varies within a window, and its correlation time [s].
FAST_SHARE, FAST_S = 0.5, 3.0
#: Distance in a spatial process that corresponds to one second of a temporal one [m].
UNIT_M = 10.0
#: Maximum spacing of traced poses along the track [m]: a bin of the reference, less than any footprint.
TRACE_M = 5.0


@dataclass(frozen=True, slots=True)
class Spread:
    """One sigma of the variation between nominal approaches.

    track, height           : deviation from the published path [m], correlated over ``period`` [s]
    speed                   : ground speed, about ``speed_mean`` [m/s]
    roll, pitch, crab       : attitude about level, trimmed and along the track [rad]
    nav_horizontal, nav_vertical : navigation error [m], equal to its stated sigma; a part of the height error is fast
    latency                 : residual latency of the altimeter [s]
    dem_bias, dem_short, dem_long : error of the elevation: constant, over 30 m and over 300 m [m]

    The defaults are the assumptions of a reference, which it states (``fti.nav.integrity.assumptions``).
    """

    track: float = 15.0
    height: float = 5.0
    period: float = 60.0
    speed_mean: float = 60.0
    speed: float = 3.0
    roll: float = np.deg2rad(1.5)
    pitch: float = np.deg2rad(1.0)
    pitch_mean: float = np.deg2rad(1.0)
    crab: float = np.deg2rad(4.0)
    nav_horizontal: float = 5.0
    nav_vertical: float = 3.0
    latency: float = 0.01
    dem_bias: float = 1.0
    dem_short: float = 2.0
    dem_long: float = 2.0


NOMINAL = Spread()
#: A survey aircraft over a surveyed surface: typical flights, better than the limits assume.
TYPICAL = Spread(track=5.0, nav_horizontal=2.0, nav_vertical=1.0, dem_short=0.5, dem_long=0.5)


@dataclass(frozen=True, eq=False)
class AltimeterModel:
    """An altimeter: beam, noise [m] and quantisation.

    step : size of the output steps [m] at heights [m], any shape
    """

    sensor: ReferenceSensor
    rate_hz: float
    noise_sd: float
    step: Callable[[Array], Array]

    def beam(self) -> NearestReturn | Laser:
        """The range model."""
        if self.sensor.kind == "laser":
            return Laser(max_range=2000.0)
        return NearestReturn(beam_width=float(np.deg2rad(self.sensor.beam_deg)))

    def quantise(self, height: Array) -> Array:
        """Heights [m] with the quantisation of the output."""
        step = self.step(height)
        return np.asarray(np.rint(height / step) * step)

    def sd(self, height: Array) -> Array:
        """One sigma of a sample at heights [m]: noise, and step / sqrt(12)."""
        return np.asarray(np.hypot(self.noise_sd, self.step(height) / np.sqrt(12.0)))


def _laser_step(height: Array) -> Array:
    return np.full(np.shape(height), 0.01)


#: FreeFlight RA-4500: 25 Hz, steps of the driver's table, and 0.3 m of noise.
RA4500 = AltimeterModel(
    ReferenceSensor(kind="radar", beam_deg=40.0), rate_hz=25.0, noise_sd=0.3, step=quantisation_steps
)
#: A survey-grade laser: 25 Hz, 0.1 m, steps of 1 cm.
LASER = AltimeterModel(ReferenceSensor(kind="laser", beam_deg=0.1), rate_hz=25.0, noise_sd=0.1, step=_laser_step)
MODELS = {"ra4500": RA4500, "laser": LASER}


@dataclass(frozen=True, eq=False)
class SimulatedApproach:
    """One approach, arrays of shape (n,).

    vertical_sd, horizontal_sd : stated sigmas of navigation [m]      t : [s]      climb : [m/s]
    roll : minus the bank of the track, pitch : [rad]
    s, y, alt   : truth [m]      nav_s, nav_y, nav_alt : as navigated [m]      agl : raw height as measured, at P [m]
    """

    vertical_sd: float
    t: Array
    s: Array
    y: Array
    alt: Array
    agl: Array
    nav_s: Array
    nav_y: Array
    nav_alt: Array
    roll: Array
    pitch: Array
    climb: Array
    horizontal_sd: float = 1.0


class ApproachGround(Protocol):
    """The ground below an approach."""

    @property
    def path(self) -> ApproachPath:
        """The published approach."""

    @property
    def altimeter(self) -> AltimeterModel:
        """The altimeter above it."""

    def ranges(self, pose: Array, rng: np.random.Generator) -> Array:
        """Ranges [m] along poses, rows s, y, alt, roll, pitch, crab, without the instrument's noise; NaN: no return."""


@dataclass(frozen=True, eq=False)
class TerrainGround:
    """Terrain; of several (such as seasons of the vegetation), each approach draws one.

    receivers : each approach draws one of them; none: the range model of the altimeter
    """

    path: ApproachPath
    altimeter: AltimeterModel
    terrains: tuple[Terrain, ...]
    receivers: tuple[ReceiverVariant, ...] = ()

    def ranges(self, pose: Array, rng: np.random.Generator) -> Array:
        """Ranges by the range model of the altimeter, or of one of the receivers."""
        terrain = self.terrains[rng.integers(len(self.terrains))]
        poses = self.poses(terrain, pose)
        if not self.receivers:
            return self.altimeter.beam().measure(terrain, poses).slant_range
        receiver = self.receivers[rng.integers(len(self.receivers))]
        return measure((receiver,), terrain, poses, np.zeros((1, 2)))[:, 0, 0]

    def poses(self, terrain: Terrain, pose: Array) -> Poses:
        """Poses from rows s, y, alt, roll, pitch, crab."""
        s, y, alt, roll, pitch, crab = pose
        lat, lon = self.path.to_geodetic(s, y)
        return sensor_poses(terrain.frame, (lat, lon, alt), (roll, pitch, self.path.course(s) + crab))


def simulate(
    ground: ApproachGround,
    s_max: float,
    rng: np.random.Generator,
    *,
    s_end: float = 0.0,
    spread: Spread = TYPICAL,
    offset: Callable[[Array], Array] | None = None,
) -> SimulatedApproach:
    """One nominal approach from s_max down to s_end, displaced by ``offset(s)`` [m] to the right.

    The altimeter is at P.  Ranges are traced with the current attitude every few metres and interpolated linearly;
    samples without a return are left out.
    """
    altimeter = ground.altimeter
    speed = rng.normal(spread.speed_mean, spread.speed)
    t = np.arange(0.0, (s_max - s_end) / speed, 1.0 / altimeter.rate_hz)
    s = s_max - speed * t
    y = gauss_markov_noise(t, spread.track, spread.period, rng) + (offset(s) if offset else 0.0)
    alt = approach_altitude(ground.path, s, gauss_markov_noise(t, spread.height, spread.period, rng))
    roll_error = gauss_markov_noise(t, spread.roll, 5.0, rng)
    roll = ground.path.bank(s) + roll_error
    pitch = spread.pitch_mean + gauss_markov_noise(t, spread.pitch, 10.0, rng)
    crab = gauss_markov_noise(t, spread.crab, spread.period, rng)
    lag = rng.normal(0.0, spread.latency)
    some = np.append(np.arange(0, len(t) - 1, max(1, round(TRACE_M / speed * altimeter.rate_hz))), len(t) - 1)
    pose = np.stack((s + speed * lag, y, alt, roll, pitch, crab))
    clear = ground.ranges(pose[:, some], rng)
    measured = np.interp(t, t[some], clear)  # NaN where one of both neighbours is
    has_return = np.isfinite(measured)
    measured += rng.normal(0.0, spread.dem_bias) + _dem_error(s[0] - s, spread, rng)
    agl = _project_vertical(altimeter, measured, roll, pitch) + white_noise(t, altimeter.noise_sd, rng)
    nav = [gauss_markov_noise(t, sd, spread.period, rng) for sd in (spread.nav_horizontal,) * 2]
    nav.append(_nav_vertical(t, spread, rng))
    climb = np.gradient(alt, t)
    output = altimeter.quantise(np.maximum(np.nan_to_num(agl), 0.0))
    columns = (t, s, y, alt, output, s + nav[0], y + nav[1], alt + nav[2], roll_error, pitch, climb)
    return dataclasses.replace(
        SimulatedApproach(spread.nav_vertical, *(column[has_return] for column in columns)),
        horizontal_sd=spread.nav_horizontal,
    )


def _nav_vertical(t: Array, spread: Spread, rng: np.random.Generator) -> Array:
    """Error of the navigated height [m]: a slow part, and a fast part as in satellite fixes."""
    fast = gauss_markov_noise(t, FAST_SHARE * spread.nav_vertical, FAST_S, rng)
    return np.asarray(
        gauss_markov_noise(t, math.sqrt(1.0 - FAST_SHARE**2) * spread.nav_vertical, spread.period, rng) + fast
    )


def window_noise(nav_vertical: float, window_s: float) -> float:
    """One sigma of the navigated height within a window, mean removed [m]: fast part, and drift of the slow one.

    nav_vertical [m]; window_s : duration of a window [s].  Of a first-order Gauss-Markov process of the correlation
    time tau the variance within a short window T is sigma^2 T / (3 tau) (Gelb 1974, Applied optimal estimation, 3.8).
    """
    drift = (1.0 - FAST_SHARE**2) * window_s / (3.0 * NOMINAL.period)
    return nav_vertical * math.sqrt(FAST_SHARE**2 + drift)


def approach_altitude(path: ApproachPath, s: Array, error: Array) -> Array:
    """Altitude above the ellipsoid [m] with a height error [m] that tapers off, and a flare."""
    nominal = path.alt_path(s) + error * np.clip(s / TAPER_M, 0.0, 1.0)
    return np.maximum(nominal, path.alt_gpi - path.airfield.runway_slope * s + FLARE_M)


def _project_vertical(altimeter: AltimeterModel, measured: Array, roll: Array, pitch: Array) -> Array:
    """Vertical component of the range of a laser; the range of a radar is already a height."""
    return measured * np.cos(roll) * np.cos(pitch) if altimeter.sensor.kind == "laser" else measured


def _dem_error(along: Array, spread: Spread, rng: np.random.Generator) -> Array:
    """Varying part of elevation minus truth [m] at ascending distances [m], without the bias."""
    short = gauss_markov_noise(along / UNIT_M, spread.dem_short, 30.0 / UNIT_M, rng)
    return np.asarray(short + gauss_markov_noise(along / UNIT_M, spread.dem_long, 300.0 / UNIT_M, rng))


def draw_profile(ground: ApproachGround, s: Array, rng: np.random.Generator, spread: Spread = NOMINAL) -> Array:
    """One draw of the terrain measured by one receiver [m] at ascending path lengths s: z = alt - agl.

    Track, height, attitude and the navigated s have constant errors; elevation errors are correlated over 30 and 300 m.
    """
    sds = (spread.nav_horizontal, spread.track, spread.height, spread.roll, spread.pitch, spread.crab)
    pose = np.outer(rng.normal(0.0, sds), np.ones_like(s))
    pose[0] += s
    pose[2] = approach_altitude(ground.path, pose[0], pose[2])
    pose[3] += ground.path.bank(s)
    pose[4] += spread.pitch_mean
    measured = _project_vertical(ground.altimeter, ground.ranges(pose, rng), pose[3], pose[4])
    return np.asarray(pose[2] - measured + _dem_error(s, spread, rng))


def track_of(approach: SimulatedApproach) -> ClearanceSeries:
    """The approach as input series of the monitor."""
    a, t_ns = approach, START_NS + np.rint(approach.t * 1e9).astype(np.int64)
    return ClearanceSeries(t_ns, a.nav_s, a.nav_y, a.nav_alt, a.agl, a.roll, a.pitch, a.climb)


def sample_of(track: ClearanceSeries, k: int, vertical_sd: float, horizontal_sd: float) -> ClearanceSample:
    """Sample k of an approach."""
    columns = (track.s, track.y, track.alt, track.agl, track.roll, track.pitch, track.climb)
    s, y, alt, agl, roll, pitch, climb = (float(column[k]) for column in columns)
    t_ns = int(track.t_ns[k])
    return ClearanceSample(t_ns, t_ns, s, y, alt, agl, roll, pitch, climb, vertical_sd, horizontal_sd)


def samples(approach: SimulatedApproach) -> Iterator[ClearanceSample]:
    """All samples of an approach."""
    track = track_of(approach)
    return (sample_of(track, k, approach.vertical_sd, approach.horizontal_sd) for k in range(len(track.t_ns)))


def run_monitor(monitor: ClearanceMonitor, approach: SimulatedApproach) -> list[ClearanceIntegrity]:
    """All outputs of the monitor on this approach."""
    track, outputs = track_of(approach), list[ClearanceIntegrity]()
    k = 0
    while (k := monitor.skip(track, k)) < len(track.t_ns):
        output = monitor.step(sample_of(track, k, approach.vertical_sd, approach.horizontal_sd))
        if output is not None:
            outputs.append(output)
        k += 1
    return outputs
