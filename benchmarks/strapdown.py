"""The strapdowns compared with that of pyins: an hour without aid, on the same samples of rate and force.

    python benchmarks/strapdown.py [--hours H] [--hz F] [--seed N]

Flights are splines, independent of both; ideal sensors.  pyins is not on the package index: it is measured where it can
be imported (PYTHONPATH), and reported as missing otherwise.  The increments of pyins are those of its
``compute_increments_from_imu`` for rate sensors, and the loop is its compiled one, without the table around it.
Its gravity falls by 2 g / a a metre, without flattening, which is 1 km of height in an hour: it runs with that
(``pyins, g``), and with samples of a world with its gravity.  Speeds are the best of rounds in which all take
turns; increments count, tables do not.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
from fti.geodesy.gravity import normal_gravity
from fti.geodesy.rotations import mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef, radii
from fti.hil.flight.random_routes import calm_flight, random_flight
from fti.hil.flight.trajectory import FlightState, SplineFlight
from fti.hil.sensors.free_inertial import true_motion
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.nav.inertial.strapdown import Motion, integrate
from fti.nav.inertial.strapdown_fast import integrate_fast
from fti.study.trajectory.experiment import Integrator

try:
    import pandas as pd
    from pyins import _numba_integrate, earth, strapdown
except ImportError as error:
    MISSING = str(error)
else:
    MISSING = ""

Array = NDArray[np.float64]
#: Where each step ends (n, 3), e frame [m].
Contender = Callable[[], Array]
ROUNDS = 3
TRACKS: dict[str, Callable[[np.random.Generator, float], SplineFlight]] = {"calm": calm_flight, "lively": random_flight}
PYINS = "pyins"


class Samples(NamedTuple):
    """A flight: time (n,) [s], truth and its start, samples: accel_b (n, 3) [m/s^2], gyro_b (n, 3) [rad/s]."""

    t: Array
    state: FlightState
    start: Motion
    accel_b: Array
    gyro_b: Array


def samples(flight: SplineFlight, seconds: float, step: float) -> Samples:
    """Of ideal sensors."""
    t = step * np.arange(round(seconds / step) + 1, dtype=np.float64)
    state = flight.state(t)
    first = true_motion(flight.state(t[:1]))
    start = Motion(first.pos_e[0], first.vel_e[0], first.quat_eb[0])
    return Samples(t, state, start, specific_force_b(state), angular_rate_b(state))


def fti_contender(by: Integrator, flight: Samples, step: float) -> Contender:
    """A strapdown of this project."""
    return lambda: by(flight.start, flight.accel_b, flight.gyro_b, step, 1).pos_e


def use_pyins_gravity(flight: Samples) -> Samples:
    """Samples of the same flight with the gravity of pyins."""
    state = flight.state
    less = normal_gravity(state.lat, state.alt) - earth.gravity(np.rad2deg(state.lat), state.alt)
    down_b = mat_from_rpy(state.roll, state.pitch, state.heading)[:, 2]
    return flight._replace(accel_b=flight.accel_b + less[:, None] * down_b)


def pyins_contender(flight: Samples) -> Contender:
    """The strapdown of pyins."""
    imu_rows = np.concatenate((flight.gyro_b, flight.accel_b), axis=1)
    names = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
    imu = pd.DataFrame(imu_rows, index=flight.t, columns=names)

    def fly() -> Array:
        increments = strapdown.compute_increments_from_imu(imu, "rate")
        rows: Any = np.asarray(increments.values)
        n, state = len(rows) + 1, flight.state
        lla, vel_n, mat_nb = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3, 3))
        lla[0] = np.rad2deg(state.lat[0]), np.rad2deg(state.lon[0]), state.alt[0]
        vel_n[0], mat_nb[0] = state.vel_n[0], mat_from_rpy(state.roll[0], state.pitch[0], state.heading[0])
        theta, dv = (np.ascontiguousarray(rows[:, at : at + 3]) for at in (1, 4))
        _numba_integrate.integrate(np.ascontiguousarray(rows[:, 0]), lla, vel_n, mat_nb, theta, dv, 0, True)
        return ecef_from_geodetic(np.deg2rad(lla[:, 0]), np.deg2rad(lla[:, 1]), lla[:, 2])

    return fly


def errors(flight: Samples, pos_e: Array) -> tuple[float, float]:
    """Greatest error of the position on the level and of the height [m]."""
    lat, lon, alt = geodetic_from_ecef(pos_e)
    meridian, normal = radii(flight.state.lat)
    north = (lat - flight.state.lat) * (meridian + flight.state.alt)
    lon_error = (lon - flight.state.lon + np.pi) % (2.0 * np.pi) - np.pi
    east = lon_error * (normal + flight.state.alt) * np.cos(flight.state.lat)
    return float(np.hypot(north, east).max()), float(np.abs(alt - flight.state.alt).max())


def time_contenders(ways: dict[str, Contender]) -> tuple[dict[str, float], dict[str, Array]]:
    """Best time of each [s], and its result; the first turn compiles and does not count."""
    found = {name: way() for name, way in ways.items()}
    best = dict.fromkeys(ways, float("inf"))
    for _ in range(ROUNDS):
        for name, way in ways.items():
            begin = time.perf_counter()
            way()
            best[name] = min(best[name], time.perf_counter() - begin)
    return best, found


def main() -> int:
    """Run both tracks, print the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--hz", type=float, default=100.0)
    parser.add_argument("--seed", type=int, default=12)
    args = parser.parse_args()
    print(machine())
    print(f"{args.hours:g} h at {args.hz:g} Hz, seed {args.seed}, one thread, best of {ROUNDS} rounds")
    targets = Targets()
    for track, draw_flight in TRACKS.items():
        seconds, step = 3600.0 * args.hours, 1.0 / args.hz
        flight = samples(draw_flight(np.random.default_rng([args.seed, 0, len(track)]), seconds), seconds, step)
        ways = {
            "high order": fti_contender(integrate, flight, step),
            "live": fti_contender(integrate_fast, flight, step),
        }
        ways |= (
            {}
            if MISSING
            else {PYINS: pyins_contender(use_pyins_gravity(flight)), f"{PYINS}, g": pyins_contender(flight)}
        )
        best, found = time_contenders(ways)
        off = {name: errors(flight, pos_e) for name, pos_e in found.items()}
        for name, (level, height) in off.items():
            each = 1e9 * best[name] / len(flight.t)
            print(
                f"{track:7} {name:10} {each:8.0f} ns a sample   {level:9.2e} m on the level   {height:9.2e} m in height"
            )
        if not MISSING:
            for name in ("high order", "live"):
                no_worse = all(a <= b for a, b in zip(off[name], off[PYINS], strict=True))
                targets.check(f"{track}: {name} is off by no more than pyins", no_worse)
            ratio = best[PYINS] / best["live"]
            targets.check(f"{track}: live takes {1 / ratio:.2f} of the time of pyins; at most 1", ratio >= 1.0)
    if MISSING:
        print(f"pyins is not measured: {MISSING}")
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
