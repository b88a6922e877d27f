"""Control surfaces that fit the flight, and the pickups that see them.

The trajectory is flown by a spline, not by controls, so the deflections are worked out backwards with the classic
linear relations: in steady motion a rate needs a deflection (damping against control power), an angle of attack needs
an elevator, a turn needs a little rudder.  They have the right sign, size and rhythm; they are no flight dynamics.

    aileron    roll rate:  p b / (2 V) = (right roll) per radian of aileron / damping      right aileron up, left down
    elevator   trimmed at the approach's angle of attack; more of it, or a pitch rate, needs the elevator up
    rudder     yaw rate in a turn
    trims      what the elevator and the rudder do over half a minute; flaps: 20, then 42 degrees, as on an approach
    controls   geared to their surfaces

Source: Etkin & Reid, Dynamics of Flight, chapters 2 and 3 (the relations); gains are this project's, of a light twin.
A raw count is the table read backwards plus white noise of 1.5 counts: a 12-bit converter and a laser distance sensor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.drivers.deflection_pickups.factory import factory_tables
from fti.drivers.deflection_pickups.table import HIGHEST_RAW, Table, read_tables
from fti.hil.flight.coordinated import TRIM_AOA
from fti.hil.flight.trajectory import State
from fti.hil.sensors.errors import white
from fti.hil.world import World
from fti.service.binding import BoundDevice
from fti.types import Measurement, Stamp, SurfaceDeflection

Array = NDArray[np.float64]

SPAN, CHORD = 13.4, 1.3  # [m]
ROLL_GAIN, PITCH_GAIN, YAW_GAIN = 2.5, 12.0, 3.0  # deflection per non-dimensional rate
ELEVATOR_PER_AOA = -1.2
LEFT_PER_RIGHT = 0.62  # an aileron goes less far down than up
STICK_PER_AILERON, STICK_PER_ELEVATOR, PEDAL_PER_RUDDER = 0.9, 1.1, 0.7
TRIM_S = 30.0
#: Flaps: from when, where to [s, deg], and how fast [deg/s].
FLAP_STEPS, FLAP_RATE_DEG = ((5.0, 20.0), (30.0, 42.0)), 4.0


def deflections(state: State) -> dict[str, Array]:
    """Deflections and control positions [rad] by surface, shape (n,): down, clockwise, right, aft and nose up are +."""
    p, q, r = (state.omega_nb_b[:, i] for i in range(3))
    aileron = ROLL_GAIN * p * SPAN / (2.0 * state.tas)
    elevator = ELEVATOR_PER_AOA * (state.aoa - TRIM_AOA) - PITCH_GAIN * q * CHORD / (2.0 * state.tas)
    rudder = -YAW_GAIN * r * SPAN / (2.0 * state.tas)
    return {
        "right_aileron": -aileron,
        "left_aileron": LEFT_PER_RIGHT * aileron,
        "elevator": elevator,
        "rudder": rudder,
        "rudder_trim": -_trimmed(state.t, rudder),
        "elevator_trim": -_trimmed(state.t, elevator),
        "flaps": np.deg2rad(flap_angle_deg(state.t)),
        "stick_aileron": STICK_PER_AILERON * aileron,
        "stick_elevator": -STICK_PER_ELEVATOR * elevator,
        "pedals": -PEDAL_PER_RUDDER * rudder,
    }


def flap_angle_deg(t: Array) -> Array:
    """Flaps [deg] at t [s]: each step is driven to at a constant rate."""
    knots, angles, before = [0.0], [0.0], 0.0
    for begin, angle in FLAP_STEPS:
        knots += [begin, begin + (angle - before) / FLAP_RATE_DEG]
        angles += [before, angle]
        before = angle
    return np.asarray(np.interp(t, knots, angles))


def _trimmed(t: Array, values: Array) -> Array:
    """The mean of a signal over the last half minute."""
    step = t[1] - t[0] if len(t) > 1 else 1.0
    count = max(1, round(TRIM_S / step))
    sums = np.cumsum(np.concatenate((np.full(count, values[0]), values)))
    return np.asarray((sums[count:] - sums[:-count]) / count)


def raw_counts(table: Table, angle: Array, noise: Array) -> NDArray[np.int64]:
    """Counts of a pickup with this table at angles [rad]; beyond the table it goes on with its outermost slope."""
    points = np.array([(p.deflection, p.raw) for p in table.as_points()])
    points = points[np.argsort(points[:, 0])]
    slopes = np.diff(points[:, 1]) / np.diff(points[:, 0])
    inside = np.interp(angle, points[:, 0], points[:, 1])
    beyond = np.minimum(angle - points[0, 0], 0.0) * slopes[0] + np.maximum(angle - points[-1, 0], 0.0) * slopes[-1]
    return np.asarray(np.clip(np.rint(inside + beyond + noise), 0, HIGHEST_RAW), dtype=np.int64)


class DeflectionPickups:
    """Raw counts; the nodes make deflections of them with the tables that they have stored."""

    rate_hz = 10.0
    time_scale = None
    NOISE_COUNTS = 1.5

    def __init__(self, bound: BoundDevice, world: World, t: Array, rng: np.random.Generator) -> None:
        angles = deflections(world.state(t))
        tables = factory_tables(angles) | read_tables(getattr(bound.options, "calibration", ""), angles)
        self._raw = {s: raw_counts(tables[s], angles[s], white(t, self.NOISE_COUNTS, rng)) for s in angles}

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Every sensor; a bus sends those that it has."""
        return [
            SurfaceDeflection(stamp=stamp, surface=s, deflection=None, raw=int(raw[k])) for s, raw in self._raw.items()
        ]
