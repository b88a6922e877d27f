"""Samples for the fit of a receiver: raw values of one altimeter on recorded flights, and the navigated poses.

Source: the derived outputs of navigation, as for recorded approaches (``recorded_approaches``).  Values that the device
flags, or that are out of its range, are excluded.  Values that only the comparison with terrain or the attitude limits
reject are included: the configured receiver may be wrong, and a bank shows the edge of the beam.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.errors import MissingError
from fti.logger.reading.json_message import parse_table, using_message
from fti.logger.reading.recording import Recording
from fti.messages.reasons import Reason
from fti.nav.altimetry.altimeter_channel import TERRAIN_REASONS
from fti.nav.altimetry.sigmas import POSITION_SD_UNKNOWN
from fti.nav.navigation import FILTER, RADIO, VERTICAL

HEIGHT, SOLUTION = "/nav/height_above_ground/", "/nav/nav_solution"
#: Maximum gap between solutions for interpolation [s].
MAX_SOLUTION_GAP_S = 0.5
#: Altitude sources that may depend on the altimeter itself.
COMPUTED_ALTITUDES = (FILTER, VERTICAL, RADIO)
ACCEPTED_REASONS = TERRAIN_REASONS | {Reason.ROLL, Reason.PITCH}
_POSE = ("lat", "lon", "alt", "roll", "pitch", "heading", "vel_north", "vel_east", "vel_down")


@dataclass(frozen=True, eq=False)
class FitSamples:
    """Samples of one altimeter, arrays (n,).

    t : since the first one of its session [s]      session : number of the session      value : measured [m]
    lat, lon [rad], alt [m, ellipsoid], roll, pitch, heading [rad] : of P      vel_n : (n, 3) [m/s]
    vertical_sd : stated one sigma of alt, 5 m if it is unknown
    """

    t: Array
    session: NDArray[np.int_]
    value: Array
    lat: Array
    lon: Array
    alt: Array
    roll: Array
    pitch: Array
    heading: Array
    vel_n: Array
    vertical_sd: Array

    def __len__(self) -> int:
        return len(self.t)

    def thin(self, count: int) -> FitSamples:
        """At most ``count`` samples, evenly spread."""
        if len(self) <= count:
            return self
        chosen = np.linspace(0, len(self) - 1, count).astype(np.intp)
        return FitSamples(**{field.name: getattr(self, field.name)[chosen] for field in fields(self)})


def concatenate_samples(parts: Sequence[FitSamples]) -> FitSamples:
    """The samples of several sessions, concatenated."""
    names = [field.name for field in fields(FitSamples)]
    return FitSamples(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def read_samples(folder: Path, sensor: str, session: int = 0) -> FitSamples:
    """The samples of an altimeter in a session.  Raises MissingError if it has no values with a position."""
    recording = Recording.open(folder)
    values, poses = list[tuple[float, ...]](), list[tuple[float, ...]]()
    for topic, t_ns, _, _, data in recording.messages("/nav/"):
        with using_message(topic, t_ns):
            if topic == HEIGHT + sensor:
                values += values_of(parse_table(data))
            elif topic == SOLUTION:
                poses += poses_of(parse_table(data))
    if values and poses:
        fit_samples = _interpolate_poses(np.array(sorted(values)), np.array(sorted(poses)), session)
        if len(fit_samples):
            return fit_samples
    raise MissingError(f"{folder}: has no values of {sensor!r} with a position; run fti reprocess")


def values_of(output: dict[str, Any]) -> Iterator[tuple[float, float]]:
    """Time of validity [ns] and value [m] of a height, if it is a range to the ground."""
    if (
        output["raw"] is not None
        and output["t_valid_ns"] is not None
        and ACCEPTED_REASONS.issuperset(output["reasons"])
    ):
        yield float(output["t_valid_ns"]), float(output["raw"])


def poses_of(output: dict[str, Any]) -> Iterator[tuple[float, ...]]:
    """Time of validity [ns], ``_POSE`` and the sigma of the altitude of a solution, if its altitude is of a device."""
    if not output["valid"] or output.get("altitude_source") in COMPUTED_ALTITUDES:
        return
    if any(output[name] is None for name in ("t_valid_ns", *_POSE[:6])):
        return
    sd = output.get("vertical_sd")
    yield (
        float(output["t_valid_ns"]),
        *(float(output[name] or 0.0) for name in _POSE),
        POSITION_SD_UNKNOWN if sd is None else float(sd),
    )


def _interpolate_poses(values: Array, poses: Array, session: int) -> FitSamples:
    """Poses at the times of the values; values without a pose are excluded."""
    begin = values[0, 0]
    t, t_pose = (values[:, 0] - begin) * 1e-9, (poses[:, 0] - begin) * 1e-9
    after = np.clip(np.searchsorted(t_pose, t), 1, max(len(t_pose) - 1, 1))
    near = (t >= t_pose[0]) & (t <= t_pose[-1])
    if len(t_pose) > 1:
        near &= t_pose[after] - t_pose[after - 1] <= MAX_SOLUTION_GAP_S
    poses[:, 2], poses[:, 6] = np.unwrap(poses[:, 2]), np.unwrap(poses[:, 6])
    pose = np.array([np.interp(t[near], t_pose, column) for column in poses.T[1:]])
    pose[5] = np.remainder(pose[5], 2.0 * math.pi)
    number = np.full(int(near.sum()), session)
    lat, lon, alt, roll, pitch, heading = pose[:6]
    return FitSamples(t[near], number, values[near, 1], lat, lon, alt, roll, pitch, heading, pose[6:9].T, pose[9])
