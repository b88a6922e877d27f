"""An hour of flight with few satellites, five DME stations and a radio altimeter.

A circle of 15 km radius at 36.72 deg north, 127.5 deg east, between 15 m and 2975 m above ground that rises and falls
by 110 m with slopes of up to 4 %.  Of the 24 GPS satellites of ``fti.hil.sensors.constellation`` above the horizon, the
source uses those above the median elevation: four or five, and from minute 20 to 40 the three highest.  The stations
are invented.  Errors are white: from run to run, and from epoch to epoch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Mask, Rng
from fti.geodesy.formulas import EARTH_RATE
from fti.geodesy.local import LocalFrame
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.hil.sensors.constellation import Constellation
from fti.nav.least_squares import AltitudeObservation, RangeObservation, solve
from fti.nav.radio.altitude_accuracy import UNIFORM, AltitudeSource, altimeter_sd, choose_altitude
from fti.parallel_runs import Progress

LAT, LON = math.radians(36.72), math.radians(127.5)
HOUR_S, EPOCH_S, SKY_S = 3600.0, 10.0, 12_600.0
#: Interval with few satellites [s], and their number.
FEW_S, FEW = (1200.0, 2400.0), 3
RADIUS_M, LOWEST_M, HIGHEST_M = 15_000.0, 15.0, 2975.0
#: Of the stations: bearing [deg] and distance [m] from the circle's centre, height above the ellipsoid [m].
STATIONS = ((20.0, 35e3, 250.0), (95.0, 70e3, 900.0), (160.0, 50e3, 150.0), (230.0, 90e3, 700.0), (310.0, 60e3, 400.0))
#: Sigma of the source: pseudoranges and slant ranges [m]; chosen here: elevation model [m], and its geoid [m].
SATELLITE_SD, DME_SD, DEM_SD, UNDULATION = 3.0, 222.0, 3.0, 25.0
#: The ground above the sea: its mean, and waves: size and length / 2 pi [m], to the north and to the east.
GROUND_M, WAVE_N, WAVE_E = 150.0, (60.0, 2500.0), (50.0, 3100.0)
#: Heights of ``Heights`` in plots and results.
WORDS = {"ranges": "satellites and DME", "altimeter": "altimeter and ground", "fused": "the chosen one"}


@dataclass(frozen=True, eq=False)
class RadioEpoch:
    """One time of the flight.

    pos_e, place : position, e frame, shape (3,) [m]; lat, lon [rad], alt [m];  agl : height above ground [m]
    satellites_e, stations_e : shape (n, 3), (5, 3) [m]
    """

    t: float
    pos_e: Array
    place: tuple[float, float, float]
    agl: float
    satellites_e: Array
    stations_e: Array


class Geometry:
    """The flight, the sky and the stations."""

    def __init__(self) -> None:
        self._sky = Constellation()
        self._gps = np.array([system == "gps" for system, _ in self._sky.keys])
        self._frame = LocalFrame(LAT, LON, 0.0)
        self._stations_e = np.stack([self._station(*station) for station in STATIONS])

    def epochs(self) -> list[RadioEpoch]:
        """All epochs."""
        return [self.epoch(float(t)) for t in np.arange(0.0, HOUR_S + EPOCH_S, EPOCH_S)]

    def epoch(self, t: float) -> RadioEpoch:
        """At t [s]."""
        turn = 2.0 * math.pi * t / HOUR_S
        east, north = RADIUS_M * math.sin(turn), RADIUS_M * math.cos(turn)
        lat, lon, _ = map(float, self._frame.to_geodetic(np.array([east, north, 0.0])))
        agl = LOWEST_M + 0.5 * (HIGHEST_M - LOWEST_M) * (1.0 - math.cos(turn))
        alt = float(ground(np.array(lat), np.array(lon))[0]) + UNDULATION + agl
        pos_e = ecef_from_geodetic(lat, lon, alt)
        return RadioEpoch(
            t, pos_e, (lat, lon, alt), agl, self._visible_satellites(t, pos_e, lat, lon), self._stations_e
        )

    def _visible_satellites(self, t: float, pos_e: Array, lat: float, lon: float) -> Array:
        """Used satellites, shape (n, 3), e frame."""
        angle = EARTH_RATE * (SKY_S + t)
        x, y, z = self._sky.state(SKY_S + t)[0][self._gps].T
        at_e = np.stack([x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle), z], axis=1)
        line = at_e - pos_e
        up = -(line @ mat_en(lat, lon)[:, 2]) / np.linalg.norm(line, axis=1)
        if FEW_S[0] <= t < FEW_S[1]:
            return np.asarray(at_e[np.argsort(up)[-FEW:]])
        return np.asarray(at_e[up > np.median(up[up > 0.0])])

    def _station(self, bearing_deg: float, distance: float, alt: float) -> Array:
        bearing = math.radians(bearing_deg)
        there = np.array([distance * math.sin(bearing), distance * math.cos(bearing), 0.0])
        lat, lon, _ = self._frame.to_geodetic(there)
        return ecef_from_geodetic(lat, lon, alt)


def ground(lat: Array, lon: Array) -> tuple[Array, Array, Array]:
    """Height of the ground above the sea [m], and its slopes to the north and to the east."""
    metres = 6.36e6
    north, east = metres * (lat - LAT), metres * math.cos(LAT) * (lon - LON)
    high = GROUND_M + WAVE_N[0] * np.sin(north / WAVE_N[1]) + WAVE_E[0] * np.cos(east / WAVE_E[1])
    to_north = WAVE_N[0] / WAVE_N[1] * np.cos(north / WAVE_N[1])
    return high, to_north, -WAVE_E[0] / WAVE_E[1] * np.sin(east / WAVE_E[1])


@dataclass(frozen=True, eq=False)
class Heights:
    """Errors of the height [m] and their predicted sigmas [m], of many runs at one epoch, shape (runs,) each.

    combined : the altimeter is one more observation of the least squares;  from_altimeter : its height was chosen
    """

    ranges: Array
    ranges_sd: Array
    altimeter: Array
    altimeter_sd: Array
    fused: Array
    fused_sd: Array
    combined: Array
    combined_sd: Array
    from_altimeter: Mask
    satellites: int


def measure(epoch: RadioEpoch, runs: int, rng: Rng, undulation: float = UNDULATION) -> Heights:
    """Runs of one epoch.  undulation : added to the elevation model, whose heights are above the sea [m]."""
    slants = [
        _slant(epoch, epoch.satellites_e, SATELLITE_SD, runs, rng, clock=True),
        _slant(epoch, epoch.stations_e, DME_SD, runs, rng, clock=False),
    ]
    start_e = np.broadcast_to(epoch.pos_e, (runs, 3))
    solution = solve(slants, start_e)
    assert solution is not None  # five stations fix a position
    lat, lon, alt = solution.geodetic()
    cov_n = solution.cov_n()
    agl = epoch.agl + rng.uniform(-1.0, 1.0, runs) * float(altimeter_sd(epoch.agl)) / UNIFORM
    high, *slopes = ground(lat, lon)
    slope = np.stack(slopes, axis=-1)
    position_variance = np.einsum("ri,rij,rj->r", slope, cov_n[:, :2, :2], slope)
    below = agl + high + rng.normal(0.0, DEM_SD, runs) + undulation
    below_sd = np.sqrt(altimeter_sd(agl) ** 2 + DEM_SD**2 + position_variance)
    ranges_sd = np.sqrt(cov_n[:, 2, 2])
    combined = solve([*slants, AltitudeObservation(below, below_sd)], start_e)
    assert combined is not None
    chosen = [choose_altitude(*pair) for pair in zip(ranges_sd.tolist(), below_sd.tolist(), strict=True)]
    from_altimeter = np.array([c is not None and c[0] is AltitudeSource.ALTIMETER for c in chosen])
    true = epoch.place[2]
    return Heights(
        ranges=alt - true,
        ranges_sd=ranges_sd,
        altimeter=below - true,
        altimeter_sd=below_sd,
        fused=np.where(from_altimeter, below, alt) - true,
        fused_sd=np.array([math.nan if c is None else c[1] for c in chosen]),
        combined=combined.geodetic()[2] - true,
        combined_sd=np.sqrt(combined.cov_n()[:, 2, 2]),
        from_altimeter=from_altimeter,
        satellites=len(epoch.satellites_e),
    )


def _slant(epoch: RadioEpoch, points_e: Array, sd: float, runs: int, rng: Rng, *, clock: bool) -> RangeObservation:
    exact = np.linalg.norm(points_e - epoch.pos_e, axis=1)
    return RangeObservation(
        points_e, exact + rng.normal(0.0, sd, (runs, len(points_e))), np.full(len(points_e), sd), clock
    )


def fly_hour(runs: int, seed: int, progress: Progress) -> list[Heights]:
    """Heights of every epoch."""
    epochs, found = Geometry().epochs(), []
    for k, epoch in enumerate(epochs):
        found.append(measure(epoch, runs, np.random.default_rng([seed, k])))
        progress((k + 1) / len(epochs))
    return found


def rms(found: list[Heights], name: str) -> Array:
    """Of every epoch [m]; name : of a field of ``Heights``."""
    return np.array([np.sqrt(np.mean(getattr(heights, name) ** 2)) for heights in found])
