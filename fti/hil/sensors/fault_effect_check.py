"""Check that a device sends the values that a fault changes; otherwise the fault would have no effect."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence

from fti.errors import ConfigError
from fti.hil.environment import Environment
from fti.hil.faults.navigation import MAGNETIC_HEADING
from fti.hil.sensors.base import SimulatedSensor
from fti.hil.sensors.encoding_check import Cycles, is_carried
from fti.hil.sensors.quantity_check import first_cycles
from fti.hil.sensors.sent_rates import encode_cycles, sent_kinds
from fti.hil.tables.fault_types import (
    AttitudeOffset,
    GnssRamp,
    InertialBias,
    LeverArm,
    Mounting,
    SwappedCoordinates,
    Undulation,
)
from fti.messages.measurements import BeamRange, Position, RadioHeight, Range, RangeScan, Reading, Velocity

OutputFault = GnssRamp | SwappedCoordinates | Undulation | LeverArm | Mounting | AttitudeOffset | InertialBias
#: Two periods of the rarest measurement, which is sent once a second [s].
CHECK_DURATION_S = 2.0
POSITION_FIELDS = ("position.lat", "position.lon", "position.alt", "position.alt_msl")
#: Readings of an inertial unit without samples, by axis: forward, right, down.
RATES = ("roll_rate", "pitch_rate", "yaw_rate")
ACCELERATIONS = ("longitudinal_acceleration", "lateral_acceleration", "normal_acceleration")
#: Measurements that depend on the position of a device; readings of ranges by the prefix of their names.
POSITION_DEPENDENT, RANGES = (Position, Velocity, Range, RadioHeight), "range_"
#: Measurements along a direction that is fixed to the device.
DIRECTED = (Range, BeamRange, RangeScan)


def check_fault_effects(sensors: Sequence[SimulatedSensor], world: Environment) -> None:
    """Raises ConfigError when a named device, or without names every device, does not send what a fault changes."""
    faults = [(i, fault) for i, fault in enumerate(world.scenario.fault) if isinstance(fault, OutputFault)]
    sound = copy.copy(world)  # without faults, because a device without fix in the first seconds sends no position
    sound.scenario = world.scenario.model_copy(update={"fault": ()})
    for i, fault in faults:
        named = [sensor for sensor in sensors if fault.includes_device(sensor.name)]
        missing = {sensor.name: values for sensor in named if (values := _missing(fault, sensor, sound))}
        if missing and (fault.devices or len(missing) == len(named)):
            name, values = next(iter(missing.items()))
            raise ConfigError(f"{world.scenario.source_name}: fault[{i}].devices: {name!r} does not send {values}")


def _missing(fault: OutputFault, sensor: SimulatedSensor, world: Environment) -> str:
    """Values that a fault changes and the device does not send; "" if it sends them."""
    cycles = first_cycles(sensor, CHECK_DURATION_S, world)
    if isinstance(fault, LeverArm):
        return "" if _sends(sensor, cycles, POSITION_DEPENDENT) else "a position, a velocity or a range"
    if isinstance(fault, Mounting):
        return "" if _sends(sensor, cycles, DIRECTED) else "a range along a direction"
    sent = list(encode_cycles(sensor.bound, cycles))
    for values, alternatives in _required_values(fault).items():
        if not any(is_carried(sensor, name, cycles, sent) for name in alternatives):
            return values
    return ""


def _sends(sensor: SimulatedSensor, cycles: Cycles, kinds: tuple[type, ...]) -> bool:
    """Does it send measurements of these kinds, or readings of ranges?"""
    has_ranges = any(isinstance(m, Reading) and m.name.startswith(RANGES) for cycle in cycles for m in cycle)
    return has_ranges or any(issubclass(kind, kinds) for kind in sent_kinds(sensor, cycles))


def _required_values(fault: OutputFault) -> Mapping[str, Sequence[str]]:
    """Values that the device must send, each with alternative fields."""
    match fault:
        case SwappedCoordinates():
            return {"a latitude": POSITION_FIELDS[:1], "a longitude": POSITION_FIELDS[1:2]}
        case Undulation(stated="zero"):
            return {"an undulation or a height above the ellipsoid": ("position.undulation", "position.alt")}
        case Undulation():
            return {"a height above the ellipsoid": ("position.alt",)}
        case AttitudeOffset():
            return dict(_angles(fault))
        case InertialBias():
            return dict(_axes(fault))
    return {"a position": POSITION_FIELDS}


def _angles(fault: AttitudeOffset) -> Iterator[tuple[str, Sequence[str]]]:
    for angle in ("roll", "pitch", "heading"):
        magnetic = (f"reading[{MAGNETIC_HEADING}].value",) if angle == "heading" else ()
        if getattr(fault, f"{angle}_deg"):
            yield f"a {angle}", (f"attitude.{angle}", *magnetic)


def _axes(fault: InertialBias) -> Iterator[tuple[str, Sequence[str]]]:
    for value, steps, field, readings in (
        ("an angular rate", fault.gyro_degph, "gyro_b", RATES),
        ("a specific force", fault.accel_mg, "accel_b", ACCELERATIONS),
    ):
        for axis, (step, reading) in enumerate(zip(steps, readings, strict=True)):
            if step:
                yield f"{value} of axis {'xyz'[axis]}", (f"imu_sample.{field}_{axis}", f"reading[{reading}].value")
