"""A recorded flight from a table or a session, filtered on request, and checked for plausibility.

A table is a CSV file with one line per sample and column names in the first line:

    t_s, lat_deg, lon_deg, alt_m (above the ellipsoid), roll_deg, pitch_deg, heading_deg

Columns may be in any order; other columns are ignored.  Lines that begin with ``#`` are comments.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from fti.errors import ConfigError, MissingError
from fti.hil.flight.session import read_session
from fti.hil.flight.smoothing import FlightFit, fit
from fti.hil.flight.trajectory import FlightSamples, SplineFlight
from fti.hil.tables.flights import RecordedFlight

TIME, ALTITUDE = "t_s", "alt_m"
ANGLES = ("lat_deg", "lon_deg", "roll_deg", "pitch_deg", "heading_deg")
COLUMNS = (TIME, "lat_deg", "lon_deg", ALTITUDE, "roll_deg", "pitch_deg", "heading_deg")
#: Largest allowed absolute values by column.
MAX_VALUES_DEG = {"lat_deg": 90.0, "lon_deg": 360.0, "roll_deg": 180.0, "pitch_deg": 90.0, "heading_deg": 360.0}
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


# ---------------------------------------------------------------------------------------------------------------- table


def read_table(file: Path) -> FlightSamples:
    """The samples of a file.  Raises MissingError, and ConfigError with the line that is wrong."""
    try:
        text = file.read_text(encoding="utf-8-sig")  # spreadsheets write a byte order mark
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not UTF-8 text"
        raise MissingError(f"{file}: cannot be read: {reason}") from None
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip() and line[0] != "#"]
    if not lines:
        raise ConfigError(f"{file}: no table found; the first line must name the columns {', '.join(COLUMNS)}")
    header = [name.strip() for name in lines[0][1].split(",")]
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise ConfigError(f"{file}: line {lines[0][0]}: missing columns {', '.join(missing)}")
    rows = np.array([_numbers(file, number, line, header) for number, line in lines[1:]]).reshape(-1, len(COLUMNS))
    column = dict(zip(COLUMNS, rows.T, strict=True))
    lat, lon, roll, pitch, heading = (np.deg2rad(column[name]) for name in ANGLES)
    return FlightSamples(column[TIME], lat, lon, column[ALTITUDE], roll, pitch, heading)


def write_table(samples: FlightSamples, file: Path, remarks: Iterable[str]) -> None:
    """Write samples in the format of ``read_table``, with a resolution of 1e-9 deg (0.1 mm), 1 mm and 1e-5 deg."""
    angles = [np.rad2deg(a) for a in (samples.lat, samples.lon, samples.roll, samples.pitch, samples.heading)]
    lat, lon, roll, pitch, heading = angles
    lines = [f"# {remark}" for remark in remarks] + [",".join(COLUMNS)]
    for t, *position, a, b, c in zip(samples.t, lat, lon, samples.alt, roll, pitch, heading, strict=True):
        lines.append(f"{t:.3f},{position[0]:.9f},{position[1]:.9f},{position[2]:.3f},{a:.5f},{b:.5f},{c:.5f}")
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _numbers(file: Path, number: int, line: str, header: list[str]) -> list[float]:
    cells = next(csv.reader([line]))
    if len(cells) != len(header):
        raise ConfigError(f"{file}: line {number}: {len(cells)} values under {len(header)} columns")
    values = dict(zip(header, cells, strict=True))
    return [_number(file, number, name, values[name]) for name in COLUMNS]


def _number(file: Path, number: int, name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ConfigError(f"{file}: line {number}: {name} = {text!r}: is not a number") from None
    max_value = MAX_VALUES_DEG.get(name, math.inf)
    if not math.isfinite(value) or abs(value) > max_value:
        raise ConfigError(f"{file}: line {number}: {name} = {text}: must be a number up to {max_value:g}")
    return value
