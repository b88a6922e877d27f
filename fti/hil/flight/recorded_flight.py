"""A flight that was flown before: from a table or a session, filtered if asked for, and judged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fti.errors import ConfigError
from fti.hil.flight.csv_flight import read_table
from fti.hil.flight.session import read_session
from fti.hil.flight.smoothing import FlightFit, fit
from fti.hil.flight.trajectory import FlightSamples, SplineFlight
from fti.hil.tables.flights import RecordedFlight

Array = NDArray[np.float64]

#: No aircraft is accelerated more than this [m/s^2]: what is comes of steps or noise in the samples.
MAX_ACCEL_MPS2 = 150.0
#: Where the flight is looked at for it, per sample.
CHECKS_PER_SAMPLE = 2


def recorded_flight(table: RecordedFlight, wind_n: tuple[float, float]) -> tuple[SplineFlight, str]:
    """The flight, t = 0 at ``from_s`` of the recording, and how well it fits, in words.

    wind_n : where the wind blew to, north and east [m/s]; the recording does not know it

    Raises MissingError or ConfigError with the file and what is wrong with it.
    """
    file = Path(table.file)
    recorded = read_session(file, table.device) if file.is_dir() else read_table(file)
    try:
        samples = replace(_shift_times(recorded, table.from_s), wind_n=(*wind_n, 0.0))
        found = fit(samples, table.smooth_s)
        length = found.flight.end if table.duration_s is None else table.duration_s
        flight = found.flight.section(0.0, length)
    except ValueError as error:
        raise ConfigError(f"{file}: {error}") from None
    _check_acceleration(found, file, table.smooth_s)
    return flight, f"{file.name}: {found.error_text()}"


def _shift_times(samples: FlightSamples, from_s: float) -> FlightSamples:
    """Times from the first sample on, then from ``from_s`` on; what is before is kept for the spline's sake."""
    if len(samples.t) == 0:
        raise ValueError("no sample")
    return replace(samples, t=samples.t - samples.t[0] - from_s)


def _check_acceleration(found: FlightFit, file: Path, smooth_s: float | None) -> None:
    flight = found.flight
    t = np.linspace(flight.begin, flight.end, CHECKS_PER_SAMPLE * len(found.filtered_samples.t))
    accel = np.linalg.norm(flight.state(t).accel_e, axis=1)
    k = int(np.argmax(accel))
    if accel[k] > MAX_ACCEL_MPS2:
        now = "none" if smooth_s is None else f"{smooth_s} s"
        raise ConfigError(
            f"{file}: the flight shakes, {accel[k]:.0f} m/s^2 at {t[k]:.2f} s: its samples have steps or noise; "
            f"give flight.smooth_s, or more of it (now {now})"
        )
