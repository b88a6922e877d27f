"""The table of messages that become measurements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from fti.drivers.imar_ixcom import inertial, satellites, solution, surroundings, sysstat
from fti.drivers.imar_ixcom.deviations import EKFSTDDEV, ITEMS, decode_deviations
from fti.drivers.imar_ixcom.heard import Heard
from fti.drivers.imar_ixcom.options import NAMES
from fti.drivers.imar_ixcom.readings import decode_items
from fti.drivers.imar_ixcom.wire import Frame
from fti.types import Measurement


class Message(NamedTuple):
    """A message that is understood.

    carries : for people; size : of its payload [B], or None where it varies; decode : None for what does not fit
    tells_status : a DeviceStatus goes before each of them, not only when it has changed
    """

    name: str
    carries: str
    size: int | None
    decode: Callable[[Frame, Heard], list[Measurement] | None]
    tells_status: bool = False


def decode_ekfstddev(frame: Frame, heard: Heard) -> list[Measurement]:
    """A Reading each; what the solution needs is kept for it."""
    values = EKFSTDDEV.unpack(frame.payload)
    heard.keep_deviations(frame.stamp, decode_deviations(values))
    return [*decode_items(frame.stamp, ITEMS, values)]


TABLE = (
    Message("IMURAW", "inertial sample, calibrated", inertial.IMU.size, inertial.decode_imuraw),
    Message("IMUCORR", "inertial sample, corrected by the filter", inertial.IMU.size, inertial.decode_imucorr),
    Message("IMUCOMP", "acceleration without gravity, rate without the Earth's: readings, no inertial sample",
            inertial.IMU.size, inertial.decode_imucomp),
    Message("INSSOL", "inertial sample, attitude, velocity, position and status of the navigation solution",
            solution.INSSOL.size, solution.decode_inssol, tells_status=True),
    Message("INSRPY", "attitude", solution.THREE.size, solution.decode_insrpy),
    Message("INSVELNED", "velocity", solution.THREE.size, solution.decode_insvelned),
    Message("INSVELENU", "velocity", solution.THREE.size, solution.decode_insvelenu),
    Message("INSPOSLLH", "position", solution.POSITION.size, solution.decode_insposllh),
    Message("INSGNDSPEED", "ground speed, track and velocity down", solution.THREE.size, solution.decode_insgndspeed),
    Message("EKFSTDDEV", "standard deviations: readings, and the sigma of what follows",
            EKFSTDDEV.size, decode_ekfstddev),
    Message("GNSSSOL", "position, velocity, satellites and status of the GNSS receiver",
            satellites.GNSSSOL.size, satellites.decode_gnsssol, tells_status=True),
    Message("AIRDATA", "airspeeds, pressures, pressure altitude, temperature",
            surroundings.AIRDATA.size, surroundings.decode_airdata),
    Message("MAGDATA", "magnetic field; magnetic heading as a reading",
            surroundings.MAGDATA.size, surroundings.decode_magdata),
    Message("WHEELDATA", "odometer: readings", surroundings.WHEELDATA.size, surroundings.decode_wheeldata),
    Message("SYSSTAT", "every bit of the system's status, by name", None, sysstat.decode_sysstat),
    Message("EXTHEIGHT", "height from outside, in and out: readings",
            surroundings.EXTHEIGHT.size, surroundings.decode_extheight),
)  # fmt: skip
BY_NAME = {message.name: message for message in TABLE}
#: Every number that a frame can have: its name, and its message where that is understood.
BY_NUMBER: Mapping[int, tuple[str, Message | None]] = {
    number: (name, BY_NAME.get(name)) for number in range(256) for name in [NAMES.get(number, f"0x{number:02X}")]
}
