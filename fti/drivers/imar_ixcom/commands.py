"""Commands to the system and its responses.

    COMMAND 0xFD    0 command u16 | 2 specific u16, 0 | 4 its arguments
    0 LOG      message u8 | trigger u8: 0 synchronous, 1 event, 2 polled | 0 add, 3 clear, 4 clear all u16 | divider u16
    3 CONF     0 save u32
    4 EKF      0 align, 1 save position, 2 save heading, 5 alignment complete u16 | number of arguments u16
    5 XCOM     0 close, 1 open, 2 reboot u16 | channel u16
    7 EXTAID   time d [s] | time mode u16: 0 GPS second of the week, 1 latency | 6 height u16 | height d | sd d [m]

    PARAMETER 0xFF  0 parameter u16 | 2 reserved u8 | 3 action u8: 0 change | 4 its value
    803 PARDAT_SYSSTAT    mode of SYSSTAT u32

    RESPONSE 0xFE   0 response u16, 0 is OK | 2 length u16 | 4 text

The system answers every command and parameter with a RESPONSE that repeats the frame counter of the request.  Each
command therefore has its own counter, which identifies the response.  EXTHEIGHT is a message, not a command, and has no
response.  The maker's package aids with a height by ``aid_height``, which has a response.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from fti.drivers import Command
from fti.drivers._arguments import number_or_nan
from fti.drivers.imar_ixcom.environment_messages import encode_extheight
from fti.drivers.imar_ixcom.options import CHANNELS, NUMBERS, REQUESTABLE, Options, check_name
from fti.drivers.imar_ixcom.wire import IxcomFrame, encode_frame
from fti.messages.measurements import Ack

LOG, CONF, EKF, XCOM, EXTAID = 0, 3, 4, 5, 7
ADD, CLEAR, CLEAR_ALL = 0, 3, 4
SYNCHRONOUS, EVENT, POLLED = 0, 1, 2
CLOSE, OPEN, REBOOT = 0, 1, 2
EVENT_DIVIDER = 500  # unused here, but some messages refuse 1 according to the maker's package
PARDAT_SYSSTAT = 803
HEIGHT_AIDING, ABSOLUTE, LATENCY = 6, 0, 1
WEEK_S = 604_800.0
RESPONSES = (
    "ok", "invalid parameter", "invalid checksum", "invalid log", "invalid rate", "invalid port", "invalid command",
    "invalid id", "invalid channel", "out of range", "log exists", "invalid trigger", "internal error",
    "path exists", "uart buffer overflow", "stored value has not been set", "magnetometer error in alignment",
    "configuration error", "parameter cannot be changed", "gnss port already in use", "user-defined message",
    "recorder not running", "invalid length", "not implemented", "deprecated", "invalid plugin", "command rejected",
    "too many logs",
)  # fmt: skip
RESPONSE = struct.Struct("<HH")
FIRST_COUNTER = 0x80

Payload = tuple[int, bytes]  # number of the message, payload


def log(message: int, trigger: int, action: int, divider: int) -> Payload:
    """The LOG command."""
    return NUMBERS["COMMAND"], struct.pack("<HHBBHH", LOG, 0, message, trigger, action, divider)


def request(name: str, divider: int) -> Payload:
    """Request a message with every ``divider``-th navigation sample, or at every change (0)."""
    if divider:
        return log(REQUESTABLE[name], SYNCHRONOUS, ADD, divider)
    return log(REQUESTABLE[name], EVENT, ADD, EVENT_DIVIDER)


def xcom(mode: int, channel: int) -> Payload:
    """The XCOM command."""
    return NUMBERS["COMMAND"], struct.pack("<HHHH", XCOM, 0, mode, channel)


def ekf(subcommand: int) -> Payload:
    """The EKF command."""
    return NUMBERS["COMMAND"], struct.pack("<HHHH", EKF, 0, subcommand, 0)


# ----------------------------------------------------------------------------------------------------- arguments


class Arguments:
    """Access to the arguments of a command by name.  Raises ValueError."""

    def __init__(self, command: str, values: Mapping[str, str], allowed: Mapping[str, str]) -> None:
        self._command, self._values, self._allowed = command, values, allowed
        for name in values:
            if name not in allowed:
                raise ValueError(f"{command}: no argument {name!r}; allowed: {', '.join(allowed) or 'none'}")

    def text(self, name: str) -> str:
        """An argument as text."""
        if name not in self._values:
            raise ValueError(f"{self._command}: {name} is missing: {self._allowed[name]}")
        return self._values[name]

    def real(self, name: str, low: float, high: float, default: float | None = None) -> float:
        """A number in [low, high]."""
        if default is not None and name not in self._values:
            return default
        text = self.text(name)
        value = number_or_nan(text)
        if not low <= value <= high:
            raise ValueError(f"{self._command}: {name} = {text!r}: must be a number from {low:g} to {high:g}")
        return value

    def integer(self, name: str, low: int, high: int, default: int | None = None) -> int:
        """A whole number in [low, high]."""
        value = float(self.real(name, low, high, default))
        if not value.is_integer():
            raise ValueError(f"{self._command}: {name} = {value:g}: must be a whole number from {low} to {high}")
        return int(value)

    def message(self) -> int:
        """The number of the named message."""
        try:
            return REQUESTABLE[check_name(self.text("message"))]
        except ValueError as error:
            raise ValueError(f"{self._command}: {error}") from None


def _request(arguments: Arguments) -> Payload:
    arguments.message()
    return request(arguments.text("message"), arguments.integer("divider", 0, 0xFFFF, 1))


def _external_height(arguments: Arguments) -> Payload:
    height, sd = arguments.real("height", -1000.0, 100_000.0), arguments.real("sd", 1e-3, 10_000.0)
    return NUMBERS["EXTHEIGHT"], encode_extheight(height, sd, arguments.real("time", 0.0, WEEK_S, 0.0))


def _aid_height(arguments: Arguments) -> Payload:
    height, sd = arguments.real("height", -1000.0, 100_000.0), arguments.real("sd", 1e-3, 10_000.0)
    time = arguments.real("time", 0.0, WEEK_S, -1.0)
    mode, seconds = (LATENCY, 0.0) if time < 0.0 else (ABSOLUTE, time)
    return NUMBERS["COMMAND"], struct.pack("<HHdHHdd", EXTAID, 0, seconds, mode, HEIGHT_AIDING, height, sd)


def _status_words(arguments: Arguments) -> Payload:
    mode = arguments.integer("mode", 0, 0x3FF)
    return NUMBERS["PARAMETER"], struct.pack("<HBBI", PARDAT_SYSSTAT, 0, 0, mode)


# ------------------------------------------------------------------------------------------------------ the table


class CommandSpec(NamedTuple):
    """A command and the function for its frame."""

    command: Command
    make: Callable[[Arguments], Payload]


MESSAGE = {"message": "name of the message, like INSSOL"}
CHANNEL = {"channel": "logical channel, 0 to 31; default 0"}
HEIGHT = {"height": "above the WGS84 ellipsoid [m], -1000 to 100000", "sd": "one sigma of it [m], 0.001 to 10000"}

COMMAND_SPECS = {
    "external_height": CommandSpec(
        Command(
            "aid the navigation with a height, as the message EXTHEIGHT",
            HEIGHT | {"time": "time of validity, GPS second of the week [s], 0 to 604800; default 0: unknown"},
            answered=False,
        ),
        _external_height,
    ),
    "aid_height": CommandSpec(
        Command(
            "aid the navigation with a height, as the command EXTAID",
            HEIGHT | {"time": "time of validity, GPS second of the week [s], 0 to 604800; default: now"},
        ),
        _aid_height,
    ),
    "open_channel": CommandSpec(
        Command("open a logical channel; required for any output", CHANNEL),
        lambda a: xcom(OPEN, a.integer("channel", 0, CHANNELS - 1, 0)),
    ),
    "close_channel": CommandSpec(
        Command("close a logical channel", CHANNEL), lambda a: xcom(CLOSE, a.integer("channel", 0, CHANNELS - 1, 0))
    ),
    "request_message": CommandSpec(
        Command(
            "request a message periodically",
            MESSAGE | {"divider": "divider of the navigation rate, 1 to 65535; 0: at every change; default 1"},
        ),
        _request,
    ),
    "poll_message": CommandSpec(
        Command("request a message once", MESSAGE), lambda a: log(a.message(), POLLED, ADD, EVENT_DIVIDER)
    ),
    "stop_message": CommandSpec(Command("stop a message", MESSAGE), lambda a: log(a.message(), SYNCHRONOUS, CLEAR, 1)),
    "stop_all_messages": CommandSpec(
        Command("stop all messages"), lambda a: log(NUMBERS["INSSOL"], SYNCHRONOUS, CLEAR_ALL, 1)
    ),
    "status_words": CommandSpec(
        Command(
            "select the contents of SYSSTAT",
            {
                "mode": "sum of 1 IMU, 2 GNSS, 4 magnetometer, 8 air data, 16 filter, 32 filter general, "
                "64 additional, 128 service, 256 remaining alignment time, 512 second system word; 0 to 1023"
            },
        ),
        _status_words,
    ),
    "align": CommandSpec(Command("start a new alignment; not in flight"), lambda a: ekf(0)),
    "complete_alignment": CommandSpec(
        Command("end the stationary alignment; motion is then allowed"), lambda a: ekf(5)
    ),
    "save_position": CommandSpec(Command("store the position for the next start"), lambda a: ekf(1)),
    "save_heading": CommandSpec(Command("store the heading for the next start"), lambda a: ekf(2)),
    "save_configuration": CommandSpec(
        Command("store the configuration for the next start"),
        lambda a: (NUMBERS["COMMAND"], struct.pack("<HHI", CONF, 0, 0)),
    ),
    "reboot": CommandSpec(Command("restart the system; not in flight"), lambda a: xcom(REBOOT, 0)),
}
COMMANDS: Mapping[str, Command] = {name: spec.command for name, spec in COMMAND_SPECS.items()}
NAMES_OF_COUNTERS = {FIRST_COUNTER + i: name for i, name in enumerate(COMMAND_SPECS)}
COUNTERS = {name: counter for counter, name in NAMES_OF_COUNTERS.items()}


def command_frame(name: str, payload: Payload) -> bytes:
    """The frame of a command."""
    return encode_frame(payload[0], COUNTERS[name], 0, 0, payload[1])


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The bytes of a command.  Raises ValueError with the allowed values."""
    if name not in COMMAND_SPECS:
        raise ValueError(f"no command {name!r}; there are {', '.join(COMMAND_SPECS)}")
    spec = COMMAND_SPECS[name]
    return command_frame(name, spec.make(Arguments(name, args, spec.command.arguments)))


def on_connect(options: Options) -> Sequence[bytes]:
    """Open the channel, stop all messages, request the logs; nothing unless ``ask`` is set."""
    if not options.ask:
        return []
    requests = [("request_message", request(name, divider)) for name, divider in options.logs.items()]
    setup = [("open_channel", xcom(OPEN, options.channel)), ("stop_all_messages", log(3, SYNCHRONOUS, CLEAR_ALL, 1))]
    return [command_frame(name, payload) for name, payload in setup + requests]


def decode_response(frame: IxcomFrame) -> Ack | None:
    """The answer to a command; None if the frame is too short."""
    if len(frame.payload) < RESPONSE.size:
        return None
    number = RESPONSE.unpack_from(frame.payload)[0]
    meaning = RESPONSES[number] if number < len(RESPONSES) else f"response {number}"
    text = frame.payload[RESPONSE.size :].decode("ascii", "replace").strip("\0 \r\n")
    detail = f"{meaning}: {text}" if text and text.lower() != meaning else meaning
    return Ack(stamp=frame.stamp, command=NAMES_OF_COUNTERS.get(frame.counter, ""), accepted=number == 0, detail=detail)
