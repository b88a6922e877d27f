"""The table of decoded messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from fti.drivers.imar_ixcom import environment_messages, inertial, satellites, solution, system_status
from fti.drivers.imar_ixcom.data_selection import IMU_CORRECTED, IMU_GRAVITY_FREE, IMU_RAW
from fti.drivers.imar_ixcom.decoder_state import DecoderState
from fti.drivers.imar_ixcom.deviations import EKFSTDDEV, ITEMS, decode_deviations
from fti.drivers.imar_ixcom.generic_values import decode_generic_values
from fti.drivers.imar_ixcom.options import NAMES
from fti.drivers.imar_ixcom.wire import IxcomFrame
from fti.messages.measurements import Measurement


class IxcomMessage(NamedTuple):
    """A decoded message.

    carries : description; size : of its payload [B], or None if it varies; decode : None for a wrong payload
    emits_status : a DeviceStatus precedes each message, not only after a change
    """

    name: str
    carries: str
    size: int | None
    decode: Callable[[IxcomFrame, DecoderState], list[Measurement] | None]
    emits_status: bool = False


def decode_ekfstddev(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """A Reading for each value; the state keeps the sigmas for the solution."""
    values = EKFSTDDEV.unpack(frame.payload)
    decoder_state.set_deviations(frame.stamp, decode_deviations(values))
    return [*decode_generic_values(frame.stamp, ITEMS, values)]


TABLE = (
    IxcomMessage("IMURAW", "inertial sample, calibrated", inertial.IMU.size,
            lambda frame, _: inertial.decode_message(frame, IMU_RAW)),
    IxcomMessage("IMUCORR", "inertial sample, corrected by the filter", inertial.IMU.size,
            lambda frame, _: inertial.decode_message(frame, IMU_CORRECTED)),
    IxcomMessage("IMUCOMP", "acceleration without gravity, rate without the Earth's: readings, no inertial sample",
            inertial.IMU.size, lambda frame, _: inertial.decode_message(frame, IMU_GRAVITY_FREE)),
    IxcomMessage("INSSOL", "inertial sample, attitude, velocity, position and status of the navigation solution",
            solution.INSSOL.size, solution.decode_inssol, emits_status=True),
    IxcomMessage("INSRPY", "attitude", solution.THREE.size, solution.decode_insrpy),
    IxcomMessage("INSVELNED", "velocity", solution.THREE.size, solution.decode_insvelned),
    IxcomMessage("INSVELENU", "velocity", solution.THREE.size, solution.decode_insvelenu),
    IxcomMessage("INSPOSLLH", "position", solution.POSITION.size, solution.decode_insposllh),
    IxcomMessage("INSGNDSPEED", "ground speed, track and velocity down",
            solution.THREE.size, solution.decode_insgndspeed),
    IxcomMessage("EKFSTDDEV", "standard deviations: readings, and the sigma of what follows",
            EKFSTDDEV.size, decode_ekfstddev),
    IxcomMessage("GNSSSOL", "position, velocity, satellites and status of the GNSS receiver",
            satellites.GNSSSOL.size, satellites.decode_gnsssol, emits_status=True),
    IxcomMessage("AIRDATA", "airspeeds, pressures, pressure altitude, temperature",
            environment_messages.AIRDATA.size, environment_messages.decode_airdata),
    IxcomMessage("MAGDATA", "magnetic field; magnetic heading as a reading",
            environment_messages.MAGDATA.size, environment_messages.decode_magdata),
    IxcomMessage("WHEELDATA", "odometer: readings",
            environment_messages.WHEELDATA.size, environment_messages.decode_wheeldata),
    IxcomMessage("SYSSTAT", "every bit of the system's status, by name", None, system_status.decode_sysstat),
    IxcomMessage("EXTHEIGHT", "height from outside, in and out: readings",
            environment_messages.EXTHEIGHT.size, environment_messages.decode_extheight),
)  # fmt: skip
BY_NAME = {message.name: message for message in TABLE}
#: Message number -> name, and the message if it is decoded.
BY_NUMBER: Mapping[int, tuple[str, IxcomMessage | None]] = {
    number: (name, BY_NAME.get(name)) for number in range(256) for name in [NAMES.get(number, f"0x{number:02X}")]
}
