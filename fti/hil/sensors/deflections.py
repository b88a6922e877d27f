"""Deflections of control surfaces, and the pickups that measure them.

A flight of a flight dynamics model provides its control surfaces.  Other flights are splines without controls: their
deflections follow from the classic linear relations of steady motion.  A rate needs a deflection (damping against
control power), an angle of attack needs elevator, a turn needs a little rudder.  Sign, size and timing are plausible;
the relations are not a flight dynamics model.

    aileron    roll rate:  p b / (2 V) = (right roll) per radian of aileron / damping      right aileron up, left down
    elevator   trimmed at the approach's angle of attack; a larger one, or a pitch rate, needs the elevator up
    rudder     yaw rate in a turn
    trims      mean of elevator and rudder over half a minute; flaps: 20, then 42 degrees, as on an approach
    controls   geared to their surfaces

Source: Etkin & Reid, Dynamics of Flight, chapters 2 and 3 (the relations); gains are assumed, for a light twin.
A raw count is the inverse of the calibration table with the errors of a pickup:

    count = round(hysteresis(table^-1(slack(angle) + table error)) + noise)

slack is the play of the rod between surface and pickup, hysteresis the play in the pickup itself; the table error is
the change since the calibration: an offset, a gain and a bend, each as a share of the travel.  Noise of 1.5 counts: a
12-bit converter and a laser distance sensor.  All sizes are assumed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fti.arrays import Array
from fti.config.keys import ONE, key
from fti.devices import BoundDevice
from fti.drivers.deflection_pickups.table import MAX_RAW, CalibrationTable, factory_tables, read_tables
from fti.hil.environment import Environment
from fti.hil.flight.coordinated_flight import TRIM_AOA
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.errors import backlash, white_noise
from fti.hil.sensors.sensor_settings import DeviceSettings, settings_of
from fti.messages.measurements import Measurement, Stamp, SurfaceDeflection

SPAN, CHORD = 13.4, 1.3  # [m]
ROLL_GAIN, PITCH_GAIN, YAW_GAIN = 2.5, 12.0, 3.0  # deflection per non-dimensional rate
ELEVATOR_PER_AOA = -1.2
LEFT_PER_RIGHT = 0.62  # an aileron has less travel down than up
STICK_PER_AILERON, STICK_PER_ELEVATOR, PEDAL_PER_RUDDER = 0.9, 1.1, 0.7
TRIM_S = 30.0
#: Flaps: times and angles of the steps [s, deg], and rate [deg/s].
FLAP_STEPS, FLAP_RATE_DEG = ((5.0, 20.0), (30.0, 42.0)), 4.0


def deflections(state: FlightState, surfaces: Mapping[str, Array] | None = None) -> dict[str, Array]:
    """Deflections and control positions [rad] by surface, shape (n,): down, clockwise, right, aft and nose up are +.

    surfaces : the control surfaces of the flight, if it has any (``Environment.surfaces``)
    """
    surfaces = surfaces or fitting_surfaces(state)
    aileron, elevator, rudder = -surfaces["right_aileron"], surfaces["elevator"], surfaces["rudder"]
    return {
        **{name: surfaces[name] for name in ("right_aileron", "left_aileron", "elevator", "rudder")},
        "rudder_trim": -_trim_values(state.t, rudder),
        "elevator_trim": -_trim_values(state.t, elevator),
        "flaps": surfaces["flaps"],
        "stick_aileron": STICK_PER_AILERON * aileron,
        "stick_elevator": -STICK_PER_ELEVATOR * elevator,
        "pedals": -PEDAL_PER_RUDDER * rudder,
    }


def fitting_surfaces(state: FlightState) -> dict[str, Array]:
    """Control surfaces [rad] derived from the motion of a flight, shape (n,)."""
    p, q, r = (state.omega_nb_b[:, i] for i in range(3))
    aileron = ROLL_GAIN * p * SPAN / (2.0 * state.tas)
    return {
        "right_aileron": -aileron,
        "left_aileron": LEFT_PER_RIGHT * aileron,
        "elevator": ELEVATOR_PER_AOA * (state.aoa - TRIM_AOA) - PITCH_GAIN * q * CHORD / (2.0 * state.tas),
        "rudder": -YAW_GAIN * r * SPAN / (2.0 * state.tas),
        "flaps": np.deg2rad(flap_angle_deg(state.t)),
    }


def flap_angle_deg(t: Array) -> Array:
    """Flaps [deg] at t [s]; they move at a constant rate."""
    knots, angles, before = [0.0], [0.0], 0.0
    for begin, angle in FLAP_STEPS:
        knots += [begin, begin + (angle - before) / FLAP_RATE_DEG]
        angles += [before, angle]
        before = angle
    return np.asarray(np.interp(t, knots, angles))


def _trim_values(t: Array, values: Array) -> Array:
    """The mean of a signal over the last half minute."""
    step = t[1] - t[0] if len(t) > 1 else 1.0
    count = max(1, round(TRIM_S / step))
    sums = np.cumsum(np.concatenate((np.full(count, values[0]), values)))
    return np.asarray((sums[count:] - sums[:-count]) / count)


def raw_counts(table: CalibrationTable, angle: Array, noise: Array) -> NDArray[np.int64]:
    """Counts of an ideal pickup with this table at angles [rad]; noise : in counts."""
    return _to_integers(_counts_at(table, angle) + noise)


def _counts_at(table: CalibrationTable, angle: Array) -> Array:
    """Inverse of the table, extrapolated with its outermost slopes."""
    points = _sort_by_angle(table)
    slopes = np.diff(points[:, 1]) / np.diff(points[:, 0])
    inside = np.interp(angle, points[:, 0], points[:, 1])
    beyond = np.minimum(angle - points[0, 0], 0.0) * slopes[0] + np.maximum(angle - points[-1, 0], 0.0) * slopes[-1]
    return np.asarray(inside + beyond)


def _sort_by_angle(table: CalibrationTable) -> Array:
    points = np.array([(p.deflection, p.raw) for p in table.as_points()])
    return np.asarray(points[np.argsort(points[:, 0])])


def _to_integers(counts: Array) -> NDArray[np.int64]:
    return np.asarray(np.clip(np.rint(counts), 0, MAX_RAW), dtype=np.int64)


class PickupSettings(DeviceSettings):
    """Deflection pickups."""

    slack_deg: Annotated[float, Field(ge=0, le=10), key("slack of the rod, from end to end, at the surface", "deg")] = (
        0.05
    )
    hysteresis_counts: Annotated[
        float, Field(ge=0, le=200), key("hysteresis of the pickup, from end to end", "count")
    ] = 2.0
    table_error: Annotated[
        float,
        Field(ge=0, le=0.2),
        key("1-sigma of the errors of offset, gain and bend of the table, over half of its travel", ONE),
    ] = 0.002


class DeflectionPickups:
    """Raw counts of the pickups; the nodes convert them to deflections with their stored tables."""

    rate_hz = 10.0
    time_scale = None
    NOISE_COUNTS = 1.5

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        angles = deflections(world.state(t), world.surfaces(t))
        tables = factory_tables(angles) | read_tables(getattr(bound.options, "calibration", ""), angles)
        settings = settings_of(PickupSettings, world.scenario, bound.device.name)
        self._raw = {s: self._counts(tables[s], angles[s], settings, rng).tolist() for s in angles}

    def _counts(
        self, table: CalibrationTable, angle: Array, settings: PickupSettings, rng: np.random.Generator
    ) -> NDArray[np.int64]:
        followed = backlash(angle, np.deg2rad(settings.slack_deg))
        true = _counts_at(table, followed + table_error(table, followed, settings.table_error * rng.normal(size=3)))
        return _to_integers(backlash(true, settings.hysteresis_counts) + white_noise(angle, self.NOISE_COUNTS, rng))

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Every pickup; the encoder sends those of its bus."""
        return [SurfaceDeflection(stamp=stamp, surface=s, deflection=None, raw=raw[k]) for s, raw in self._raw.items()]


def table_error(table: CalibrationTable, angle: Array, shares: Array) -> Array:
    """Error [rad] of a pickup against its table at angles [rad].  shares : offset, gain, bend per half of the travel.

    The bend is a parabola through the ends and the middle of the travel: 1, -1, 1.
    """
    low, high = _sort_by_angle(table)[[0, -1], 0]
    half = 0.5 * (high - low)
    x = (angle - low) / half - 1.0
    return np.asarray(half * (shares[0] + shares[1] * x + shares[2] * (2.0 * x**2 - 1.0)))
