"""A simulated sensor: a model of its measurements, sampled by its own clock.

A sensor samples with its own rate, phase and clock drift.  Its message leaves after the ``latency_ms`` of the
configuration, with a little jitter.  ``[sensor.NAME]`` of the scenario overrides these; the daemon does not know a
latency given there.  All random numbers depend on the seed of the scenario and the name of the device.
"""

from __future__ import annotations

import copy
import math
import zlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.devices import BoundDevice, gives_scans
from fti.drivers import Encoder
from fti.errors import ConfigError
from fti.formats.quantities import UNITS
from fti.geodesy.rotations import mat_from_rpy, rpy_from_mat
from fti.geodesy.wgs84 import displace
from fti.hil.environment import Environment
from fti.hil.faults.applicability import applies_to
from fti.hil.flight.trajectory import FlightState
from fti.hil.tables.fault_types import Latency, LeverArm, Mounting
from fti.hil.tables.schema import SensorSettings
from fti.messages.measurements import Measurement, RangeScan, Reading, Stamp, TimeScale

DRIFT_PPM_SD = 20.0
JITTER_SD_MS = 0.3


def field_reading(stamp: Stamp, name: str, value: float, unit: str, unit_of_value: str) -> Reading:
    """A reading of a value in the unit of its field (empty: none stated); invalid where it is not finite."""
    valid = math.isfinite(value)
    scaled = value / UNITS[unit or unit_of_value][0]
    return Reading(stamp=stamp, name=name, value=scaled if valid else None, unit=unit, valid=valid)


class SensorModel(Protocol):
    """Model of one device, computed for the whole flight."""

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The measurements of sample k, in the order that the encoder needs."""


class SensorModelType(Protocol):
    """Constructor of a model, with the default rate and the time scale of its device."""

    @property
    def rate_hz(self) -> float:
        """Samples per second."""

    @property
    def time_scale(self) -> TimeScale | None:
        """Scale of the time in the messages; None when they have no time."""

    def __call__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> SensorModel:
        """A model sampled at the times t, shape (n,) [s]."""


class SimulatedSensor:
    """A device of the configuration, simulated.

    t   : true times of its samples [s after the start], shape (n,)
    due : send times of their messages [s], shape (n,), never before the sample

    is_live : its measurements depend on events during the flight, such as commands

    Raises ConfigError when it has no sample in the flight.
    """

    def __init__(self, bound: BoundDevice, model: SensorModelType, world: Environment, seed: int) -> None:
        device = bound.device
        rng = np.random.default_rng([seed, zlib.crc32(device.name.encode())])
        self.name, self.link = device.name, device.link
        self.is_live = False
        self.rate_hz = device.rate_hz or model.rate_hz
        settings = world.scenario.sensor.get(device.name) or SensorSettings()
        self.drift_ppm = _or_default(settings.drift_ppm, float(rng.normal(0.0, DRIFT_PPM_SD)))
        self._powered_s = -float(rng.uniform(20.0, 120.0))  # time of power-on, before the flight
        shift_s = _or_default(settings.shift_ms, float(rng.uniform()) * 1e3 / self.rate_hz) * 1e-3
        self.t = sample_times(self.rate_hz, world.duration, shift_s, self.drift_ppm)
        if not len(self.t):
            raise ConfigError(
                f"{world.scenario.source_name}: sensor.{self.name}: no sample in a flight of {world.duration:g} s, "
                f"the first one would be after {shift_s:g} s"
            )
        self._times: list[float] = self.t.tolist()
        jitter_s = np.abs(rng.normal(0.0, 1e-3 * _or_default(settings.jitter_ms, JITTER_SD_MS), len(self.t)))
        latency_s = 1e-3 * _or_default(settings.latency_ms, device.latency_ms)
        self.due = np.maximum.accumulate(self.t + latency_s + jitter_s)
        self.bound = bound
        self.encoder: Encoder = bound.driver.make_encoder(bound.options)
        self.model = make_model(model, bound, world, self.t, rng)
        self._time_scale = model.time_scale

    def measure(self, k: int, start_ns: int) -> list[Measurement]:
        """Measurements of sample k of a flight that began at start_ns (FTI time)."""
        return self.model.measure(k, self._stamp(self._times[k], start_ns))

    def restart(self, t: float) -> None:
        """Reset the device when power returns at t [s]: settings, counters and its time since power-on."""
        self.encoder = self.bound.driver.make_encoder(self.bound.options)
        self._powered_s = t

    def _stamp(self, t: float, start_ns: int) -> Stamp:
        true_ns = start_ns + round(t * SECOND_NS)
        if self._time_scale is TimeScale.BOOT:
            on_s = max(t - self._powered_s, 0.0) * (1.0 + 1e-6 * self.drift_ppm)
            return Stamp(true_ns, round(on_s * SECOND_NS), TimeScale.BOOT)
        return Stamp(true_ns, true_ns, TimeScale.UTC) if self._time_scale else Stamp(true_ns)


def _or_default(setting: float | None, default: float) -> float:
    return default if setting is None else setting


def sample_times(rate_hz: float, duration: float, shift: float, drift_ppm: float) -> Array:
    """True sample times [s] in [0, duration) of a clock that is drift_ppm fast.  shift : time of the first one [s]."""
    period = 1.0 / rate_hz / (1.0 + 1e-6 * drift_ppm)
    return np.asarray(np.arange(shift, duration, period))


def position_at(state: FlightState, lever_arm_b: tuple[float, float, float]) -> tuple[Array, Array, Array]:
    """lat, lon [rad], alt [m] of a point of the aircraft; lever_arm_b : from the reference point P [m]."""
    mat_nb = mat_from_rpy(state.roll, state.pitch, state.heading)
    return displace(state.lat, state.lon, state.alt, mat_nb @ np.asarray(lever_arm_b))


def velocity_at(state: FlightState, lever_arm_b: tuple[float, float, float]) -> Array:
    """Velocity of a point of the aircraft, north, east, down [m/s], shape (n, 3).

    v = v_P + mat_nb (omega_nb_b x arm_b)
    """
    mat_nb = mat_from_rpy(state.roll, state.pitch, state.heading)
    rotation_b = np.cross(state.omega_nb_b, np.asarray(lever_arm_b))
    return np.asarray(state.vel_n + np.einsum("nij,nj->ni", mat_nb, rotation_b))


class FaultyModel:
    """Two models of one device with the same random errors: as it is configured, and as it is.

    faulty : as it is, for samples with ``is_faulty``, shape (n,)
    """

    def __init__(self, configured: SensorModel, faulty: SensorModel, is_faulty: Sequence[bool]) -> None:
        self._configured, self._faulty, self._is_faulty = configured, faulty, is_faulty

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """See ``SensorModel``."""
        return (self._faulty if self._is_faulty[k] else self._configured).measure(k, stamp)


class EarlierScans:
    """The measurements of a model, with the scans of another one that measures earlier."""

    def __init__(self, model: SensorModel, earlier: SensorModel) -> None:
        self._model, self._earlier = model, earlier

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """See ``SensorModel``."""
        others = [m for m in self._model.measure(k, stamp) if not isinstance(m, RangeScan)]
        return others + [m for m in self._earlier.measure(k, stamp) if isinstance(m, RangeScan)]


ModelFault = LeverArm | Mounting | Latency


def make_model(
    kind: SensorModelType, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator
) -> SensorModel:
    """The model of a device at the times t, shape (n,) [s], with the faults of its mounting and of its scans."""
    faults = [f for f in world.scenario.fault if isinstance(f, ModelFault) and applies_to(f, bound)]
    faults = [f for f in faults if not isinstance(f, Latency) or gives_scans(bound)]
    equal_rngs = [copy.deepcopy(rng) for _ in faults]
    model = kind(bound, world, t, rng)
    for fault, equal_rng in zip(faults, equal_rngs, strict=True):
        is_faulty = (t >= fault.from_s) & (t < fault.to_s)
        if not is_faulty.any():
            continue
        if isinstance(fault, Latency):
            faulty: SensorModel = EarlierScans(model, kind(bound, world, np.maximum(t - fault.by_s, 0.0), equal_rng))
        else:
            faulty = kind(_as_mounted(bound, fault), world, t, equal_rng)
        model = FaultyModel(model, faulty, is_faulty.tolist())
    return model


def _as_mounted(bound: BoundDevice, fault: LeverArm | Mounting) -> BoundDevice:
    """The device with its true place or its true directions."""
    device = bound.device
    if isinstance(fault, LeverArm):
        offset = (fault.forward_m, fault.right_m, fault.down_m)
        update = {"lever_arm_b": tuple(a + b for a, b in zip(device.lever_arm_b, offset, strict=True))}
    else:
        turn = mat_from_rpy(*np.radians((fault.roll_deg, fault.pitch_deg, fault.yaw_deg)))
        true_angles = rpy_from_mat(turn @ mat_from_rpy(*np.radians(device.rpy_bs_deg)))
        update = {"rpy_bs_deg": tuple(math.degrees(angle) for angle in true_angles)}
    return replace(bound, device=device.model_copy(update=update))
