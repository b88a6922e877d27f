"""How the recording that is shipped was made: flown by the scenario ``pattern``, kept by a recorder of few digits.

python -m tests.hil.flight.recordings        # writes it again
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fti.hil import scenario as scenarios
from fti.hil.emulator import make_environment
from fti.hil.flight.recorded_flight import write_table
from fti.hil.flight.trajectory import FlightSamples, FlightState

Array = NDArray[np.float64]

FILE = Path(__file__).resolve().parents[3] / "configs" / "scenarios" / "recordings" / "final.csv"
BEGIN_S, END_S, RATE_HZ = 30.0, 120.0, 5.0
ORIGIN = (
    "Base turn and final, made by this project (tests/hil/flight/recordings.py): no aircraft flew it.",
    f"Seconds {BEGIN_S:.0f} to {END_S:.0f} of the scenario pattern, {RATE_HZ:.0f} samples a second; angles were kept",
    "in radians of single precision, as some recorders do: longitude comes in steps of 0.6 m.",
)


def single(values: Array) -> Array:
    """What is left of radians in single precision."""
    return values.astype(np.float32).astype(np.float64)


def quantised(state: FlightState, t: Array) -> FlightSamples:
    """A flight as such a recorder keeps it, at times t [s] of its own."""
    angles = [single(a) for a in (state.lat, state.lon, state.roll, state.pitch, state.heading)]
    lat, lon, roll, pitch, heading = angles
    return FlightSamples(t, lat, lon, state.alt, roll, pitch, heading)


def recorded() -> FlightSamples:
    """The samples of the recording."""
    t = np.arange(BEGIN_S, END_S, 1.0 / RATE_HZ)
    world = make_environment(scenarios.load(scenarios.find("pattern")))
    return quantised(world.state(t), t - BEGIN_S)


def write(file: Path) -> None:
    """Write it."""
    write_table(recorded(), file, ORIGIN)


if __name__ == "__main__":
    write(FILE)
