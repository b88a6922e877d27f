"""iMAR iXCOM: an inertial navigation system on RS-232 (INSSOL at 100 Hz) or UDP (300 Hz).

Document: iMAR iXCOM interface, as published by the maker in the package ``ixcom`` 1.3.10 (message tables, data
selection, status, commands) and in the header ``XCOMdat.h`` of the maker's repository ROS2_iNAT, December 2025 (units,
status of the GNSS receiver).  Everything is little-endian; a frame is header, payload, footer:

    header 16 B   0      1   2        3         4       6     8        12
                  0x7E   id  counter  trigger   length  week  seconds  microseconds      length u16: the whole frame
    footer  4 B   status u16 | CRC-16/XMODEM u16 over all bytes before it

    status        bit 0 hardware, 1 communication, 2 navigation, 3 calibration, 4 gyro, 5 accelerometer error
                  6 GNSS invalid, 7 standby, 8 dynamic align, 9 time invalid, 10 navigation, 11 AHRS mode
                  12-13 alignment, 14-15 position quality

Each family of messages has a module with the layout of its payloads: ``solution`` (INSSOL and its parts), ``inertial``,
``deviations``, ``satellites``, ``environment_messages`` (air data, magnetometer, odometer, external height),
``system_status``, ``commands``; ``messages`` is the table.  Other messages are framed and counted by name.

Each message has its own rolling counter (observed in a capture of a real device, not documented); the response to a
command repeats the counter of the command.

Unknown values are None: gravity-free accelerations are not a specific force, angles after DIN 70000 have another
convention, an undulation of exactly 0 means "no geoid model", and there is no device time until GNSS has set the clock
(status bit 9).

Several messages may carry the same quantity.  Only one source per device is used, so that solutions are never mixed
(see ``decoder``): for five seconds after a valid message of higher priority the others become Readings.  To get
the solution of the receiver as well, configure a second device on the link with ``only = ["GNSSSOL"]``.

The system sends nothing until a channel is opened and messages are requested, unless it is configured to start by
itself.  ``ask = true`` requests them after every connect; the system accepts commands on the serial line (over UDP it
only sends).  The emulated device sends ``logs`` from measurements of one stamp; missing values are NaN.
"""

from __future__ import annotations

from fti.drivers._no_commands import poll
from fti.drivers.imar_ixcom.commands import COMMANDS, command, on_connect
from fti.drivers.imar_ixcom.decoder import Decoder
from fti.drivers.imar_ixcom.encoder import Encoder
from fti.drivers.imar_ixcom.messages import TABLE
from fti.drivers.imar_ixcom.options import Options

__all__ = [
    "CARRIERS", "COMMANDS", "DOCUMENT", "INERTIAL", "MESSAGES", "Options", "command", "make_decoder", "make_encoder",
    "on_connect", "poll",
]  # fmt: skip

DOCUMENT = (
    "iMAR iXCOM interface as published in the maker's package ixcom 1.3.10 and header XCOMdat.h (ROS2_iNAT, 2025)"
)
MESSAGES = {message.name: message.carries for message in TABLE} | {
    "RESPONSE": "response to a command",
    "(other)": "framed and counted by name or number",
}
CARRIERS = frozenset({"serial", "udp"})
INERTIAL = True


make_decoder, make_encoder = Decoder, Encoder
