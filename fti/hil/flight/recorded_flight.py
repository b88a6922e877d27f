"""A recorded flight from a table or a session, filtered on request, and checked for plausibility."""

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

#: Larger accelerations [m/s^2] come from steps or noise in the samples.
MAX_ACCEL_MPS2 = 150.0
#: Points of the acceleration check per sample.
CHECKS_PER_SAMPLE = 2


def recorded_flight(table: RecordedFlight, wind_n: tuple[float, float]) -> tuple[SplineFlight, str]:
    """The flight, t = 0 at ``from_s`` of the recording, and the errors of its fit as text.

    wind_n : velocity of the air, north and east [m/s], which the recording does not contain

    Raises MissingError or ConfigError with the file and the error.
    """
    file = Path(table.file)
    recorded = read_session(file, table.device) if file.is_dir() else read_table(file)
    try:
        samples = replace(_shift_times(recorded, table.from_s), wind_n=(*wind_n, 0.0))
        fitted = fit(samples, table.smooth_s)
        length = fitted.flight.end if table.duration_s is None else table.duration_s
        flight = fitted.flight.section(0.0, length)
    except ValueError as error:
        raise ConfigError(f"{file}: {error}") from None
    _check_acceleration(fitted, file, table.smooth_s)
    return flight, f"{file.name}: {fitted.error_text()}"


def _shift_times(samples: FlightSamples, from_s: float) -> FlightSamples:
    """Times relative to ``from_s`` after the first sample; earlier samples are kept for the spline."""
    if len(samples.t) == 0:
        raise ValueError("no samples")
    return replace(samples, t=samples.t - samples.t[0] - from_s)


def _check_acceleration(fitted: FlightFit, file: Path, smooth_s: float | None) -> None:
    flight = fitted.flight
    t = np.linspace(flight.begin, flight.end, CHECKS_PER_SAMPLE * len(fitted.filtered_samples.t))
    accel = np.linalg.norm(flight.state(t).accel_e, axis=1)
    k = int(np.argmax(accel))
    if accel[k] > MAX_ACCEL_MPS2:
        now = "none" if smooth_s is None else f"{smooth_s} s"
        raise ConfigError(
            f"{file}: acceleration of {accel[k]:.0f} m/s^2 at {t[k]:.2f} s: the samples have steps or noise; "
            f"set or increase flight.smooth_s (now {now})"
        )
