"""Check that a device measures the quantity that a fault changes; otherwise the fault would have no effect."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence
from itertools import chain

import numpy as np

from fti.errors import ConfigError
from fti.hil.environment import Environment
from fti.hil.sensors import MODELS, SimulatedSensor
from fti.hil.tables.fault_base import QuantityFault
from fti.hil.tables.quantity_names import NAME_FIELDS, matches_quantity, parse, quantities
from fti.messages.measurements import Measurement, Reading, Stamp, TimeScale

#: Checked time of the flight [s]: some measurements are sent once a second.
CHECK_DURATION_S = 1.5


def check_fault_quantities(sensors: Sequence[SimulatedSensor], world: Environment) -> None:
    """Raises ConfigError, with the available quantities, for a device that does not measure the quantity of a fault."""
    for i, fault in enumerate(world.scenario.fault):
        if isinstance(fault, QuantityFault):
            named = [s for s in sensors if fault.includes_device(s.name)]
            measured = {s.name: list(chain(*first_cycles(s, CHECK_DURATION_S))) for s in named}
            _check(f"{world.scenario.source_name}: fault[{i}].quantity", fault, measured)


def _check(where: str, fault: QuantityFault, measured: dict[str, list[Measurement]]) -> None:
    wanted = parse(fault.quantity)
    without = {
        name: values
        for name, values in measured.items()
        if not any(matches_quantity(m, wanted, fault.name) for m in values)
    }
    if not without or (not fault.devices and len(without) < len(measured)):
        return
    name, values = next(iter(without.items()))
    quantity = fault.quantity if fault.name is None else f"{fault.quantity} of {fault.name!r}"
    raise ConfigError(f"{where}: {name!r} does not measure {quantity}; it has {', '.join(_numbers(values)) or 'none'}")


def first_cycles(
    sensor: SimulatedSensor, duration_s: float, world: Environment | None = None
) -> list[list[Measurement]]:
    """Measurements of a device in its first duration_s [s], by cycle; the sensor is not changed.

    world : another one than that of the sensor, or None
    """
    count = min(max(math.ceil(duration_s * sensor.rate_hz), 2), len(sensor.t))
    if world is None:  # some models draw random numbers for each measurement; a live one has no state of its own
        model = sensor.model if sensor.is_live else copy.deepcopy(sensor.model)
    else:
        model = MODELS[sensor.bound.device.driver](sensor.bound, world, sensor.t[:count], np.random.default_rng(0))
    stamps = (Stamp(t_ns, t_ns, TimeScale.UTC) for t_ns in (round(1e9 * t) for t in sensor.t[:count]))
    return [model.measure(k, stamp) for k, stamp in enumerate(stamps)]


def _numbers(measurements: Iterable[Measurement]) -> list[str]:
    """Names of the quantities, each once; a reading by its own name."""
    found: dict[str, None] = {}
    for m in measurements:
        names = [str(getattr(m, field)) for field in NAME_FIELDS if hasattr(m, field)]
        if isinstance(m, Reading):
            found[f"reading.value of {names[0]!r}"] = None
            continue
        for kind, numbers in quantities().items():
            fields = [key for key, q in numbers.items() if isinstance(m, q.kind) and getattr(m, q.field) is not None]
            found |= dict.fromkeys(f"{kind}.{field}" for field in fields)
    return list(found)
