"""Units on CAN: air data with DME (CANaerospace), and the messages of any DBC."""

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array
from fti.devices import BoundDevice
from fti.drivers.dbc import Options, text_of
from fti.formats.dbc_makers import quantity_scale
from fti.formats.dbc_messages import DbcMessage, DbcSignal, read_layouts
from fti.formats.quantities import QUANTITIES
from fti.hil.environment import Environment
from fti.hil.sensors.avionics import Avionics
from fti.hil.sensors.deflections import deflections
from fti.hil.sensors.dme import Interrogator
from fti.hil.sensors.errors import gauss_markov_noise
from fti.messages.measurements import Measurement, Reading, Stamp, SurfaceDeflection


class AirDataUnit:
    """Air data, heading reference and DME on CANaerospace; deflection pickups on the bus send the surfaces."""

    rate_hz = 20.0
    time_scale = None

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        self._avionics = Avionics(bound, world, t, rng)
        self._interrogator = Interrogator(world.state(t), world, t, rng)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """All measurements of sample k; the encoder sends those with a signal."""
        return self._avionics.measure(k, stamp) + self._interrogator.measure(k, stamp)


class _DriftingSignal:
    """A signal without model: it drifts around the middle of its range, or cycles through its states."""

    STATE_SAMPLES = 20
    PERIOD_S = 20.0

    def __init__(self, signal: DbcSignal, t: Array, rng: np.random.Generator) -> None:
        self.signal = signal
        self._states = list(signal.states) if signal.states and not signal.is_physical else []
        ends = [signal.min_raw * signal.factor + signal.offset, signal.max_raw * signal.factor + signal.offset]
        low, high = max(min(ends), signal.low), min(max(ends), signal.high)
        middle, width = (0.5 * (low + high), high - low) if math.isfinite(high - low) else (0.0, 10.0)
        self._values = middle + np.clip(
            gauss_markov_noise(t, 0.1 * width, self.PERIOD_S, rng), -0.4 * width, 0.4 * width
        )

    def value(self, k: int) -> float:
        """Value of sample k, in the signal's unit."""
        if self._states:
            raw = self._states[k // self.STATE_SAMPLES % len(self._states)]
            return raw * self.signal.factor + self.signal.offset
        return float(self._values[k])


class _UnitMessage:
    """One message of the DBC: values of the signals for which the flight has no quantity."""

    def __init__(self, layout: DbcMessage, t: Array, rng: np.random.Generator, counter: str) -> None:
        self._layout, self._counter = layout, counter
        self._drifting = {s.name: _DriftingSignal(s, t, rng) for s in layout.signals if s.name != counter}

    def measure(self, k: int, stamp: Stamp, available: list[Measurement]) -> list[Measurement]:
        """Readings, and measurements of quantities that are not available; multiplexers cycle through their values."""
        selected = {s.name: self._choice(s.name, k) for s in self._layout.selectors}
        signals = [s for s in self._layout.signals_for(selected) if s.name != self._counter]
        measurements = (self._one(s, selected.get(s.name), k, stamp, available) for s in signals)
        return [m for m in measurements if m is not None]

    def _choice(self, selector: str, k: int) -> int:
        choices = sorted({c for s in self._layout.signals if s.selector == selector for c in s.choices})
        return choices[k % len(choices)]

    def _one(
        self, signal: DbcSignal, selected: int | None, k: int, stamp: Stamp, available: list[Measurement]
    ) -> Measurement | None:
        scale = quantity_scale(signal)
        value = self._drifting[signal.name].value(k) if selected is None else selected * signal.factor + signal.offset
        if scale is None:
            return Reading(stamp=stamp, name=f"{self._layout.name}.{signal.name}", value=value, unit=signal.unit)
        quantity = QUANTITIES[signal.name]
        if any(quantity.pick(m) is not None for m in available):
            return None
        return quantity.make(stamp, value * scale[0] + scale[1], True)


class DbcUnits:
    """The units of any DBC: known quantities follow the flight, other signals drift."""

    rate_hz = 10.0
    time_scale = None

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        assert isinstance(bound.options, Options)
        state = world.state(t)
        self._air = AirDataUnit(bound, world, t, rng)
        self._deflections = deflections(state, world.surfaces(t))
        layouts = read_layouts(text_of(bound.options))
        self._messages = [_UnitMessage(layout, t, rng, bound.options.counter) for layout in layouts]

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Measurements of the flight, then values of the other signals."""
        available = self._air.measure(k, stamp) + [
            SurfaceDeflection(stamp=stamp, surface=surface, deflection=float(angle[k]))
            for surface, angle in self._deflections.items()
        ]
        return available + [m for message in self._messages for m in message.measure(k, stamp, available)]
