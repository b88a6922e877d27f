"""Commands in binary form, and the receiver's answers.

    LOG 1           0 port u32 | 4 message u16 | 6 format u8 (0 binary) | 7 reserved u8 | 8 trigger u32
                    12 period, offset 2d [s] | 28 hold u32
    UNLOG 36        0 port u32 | 4 message u16 | 6 format u8 | 7 reserved u8
    UNLOGALL 38     0 port u32 | 4 include held logs u32
    RESET 18        0 delay u32 [s]
    ANTENNAPOWER 98 0 off, on u32
    answer          the header with the number of the command and bit 7 of the message type | 0 code u32 (1 OK) | 4 text

The answer to an abbreviated command is ``<OK`` or ``<ERROR:text``, to an ASCII command ``#LOGR,...;OK*crc``.  Commands
of users are sent in binary form, requests after a connect in ASCII.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping

from fti.config import StrictModel
from fti.drivers import Command
from fti.drivers._arguments import check_names
from fti.drivers.novatel_oem6 import messages
from fti.drivers.novatel_oem6.framing import RESPONSE_BIT, NovatelHeader, encode_frame, encode_text
from fti.messages.measurements import Ack, Stamp

LOG = struct.Struct("<IHBBIddI")
UNLOG = struct.Struct("<IHBB")
UNLOGALL = struct.Struct("<II")
ONE = struct.Struct("<I")
CODE_OK = 1

#: Periods below 1 s that the receiver accepts for ONTIME; also whole seconds.
PERIODS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.25, 0.5)
MAX_PERIOD, MAX_DELAY = 86_400, 60
TRIGGERS = {"onnew": 0, "onchanged": 1, "ontime": 2, "onnext": 3, "once": 4, "onmark": 5}
PORTS = {
    "thisport": 192, "com1": 32, "com2": 64, "com3": 96, "usb1": 1440, "usb2": 1696, "usb3": 1952, "icom1": 4000,
    "icom2": 4256, "icom3": 4512,
}  # fmt: skip
#: UNLOGALL takes groups of ports.
GROUPS = {
    "thisport": 6, "all": 8, "com1": 1, "com2": 2, "com3": 3, "usb1": 13, "usb2": 14, "usb3": 15, "icom1": 23,
    "icom2": 24, "icom3": 25,
}  # fmt: skip
SWITCH = {"off": 0, "on": 1}

_PORT = "the port: " + ", ".join(PORTS) + " (default thisport)"
_MESSAGE = "a message by name (bestpos) or number"
COMMANDS = {
    "log": Command(
        "request a message periodically, in binary form",
        {
            "message": _MESSAGE,
            "period": "period in seconds: 0.01, 0.02, 0.05, 0.1, 0.2, 0.25, 0.5 or whole seconds up to 86400"
            " (trigger ontime needs it, the others have none)",
            "trigger": "ontime, onnew, onchanged, onnext, once, onmark (default ontime)",
            "port": _PORT,
        },
    ),
    "unlog": Command("stop a message", {"message": _MESSAGE, "port": _PORT}),
    "unlogall": Command(
        "stop all messages that are not held", {"port": "the port: " + ", ".join(GROUPS) + " (default thisport)"}
    ),
    # The document does not state whether the answer is sent before the restart.
    "reset": Command(
        "restart the receiver; its requests are lost",
        {"delay": "delay in seconds, 0 to 60 (default 0)"},
        answered=False,
    ),
    "antennapower": Command("switch the antenna supply", {"state": "on or off"}),
}
NUMBERS = {name: messages.NUMBERS[name.upper()] for name in COMMANDS}
NAMES = {number: name for name, number in NUMBERS.items()}
#: Header of a command: the receiver uses the time of its own clock.
COMMAND_HEADER = NovatelHeader(b"", 0, 0, 0, PORTS["thisport"], 0, 0, 0, 0xFF, 0, 0, 0, 0, 0)
#: Head of LOG in ASCII form.
ASCII_LOG = "LOGA,THISPORT,0,0,UNKNOWN,0,0.0,0,0,0"


def command(name: str, args: Mapping[str, str], options: StrictModel | None = None) -> bytes:
    """The bytes of a command.  Raises ValueError with the error and the allowed values."""
    check_names(COMMANDS, name, args)
    return encode_frame(COMMAND_HEADER._replace(message_id=NUMBERS[name]), _BODIES[name](args))


def check_period(seconds: float) -> float:
    """Check a period.  Raises ValueError."""
    if seconds in PERIODS or (1 <= seconds <= MAX_PERIOD and seconds == int(seconds)):
        return seconds
    allowed = ", ".join(map(str, PERIODS))
    raise ValueError(f"period = {seconds:g}: must be {allowed} or whole seconds up to {MAX_PERIOD}")


def _choice(args: Mapping[str, str], key: str, table: Mapping[str, int], default: str = "") -> int:
    text = args.get(key, default).strip().lower()
    if not text:
        raise ValueError(f"{key} is missing: must be one of {', '.join(table)}")
    if text not in table:
        raise ValueError(f"{key} = {text!r}: must be one of {', '.join(table)}")
    return table[text]


def _number(args: Mapping[str, str], key: str) -> float:
    try:
        return float(args[key])
    except KeyError:
        raise ValueError(f"{key} is missing: must be a number of seconds") from None
    except ValueError:
        raise ValueError(f"{key} = {args[key]!r}: must be a number of seconds") from None


def _message(args: Mapping[str, str]) -> int:
    if "message" not in args:
        raise ValueError(f"message is missing: must be {_MESSAGE}")
    return messages.number_of(args["message"])


def _log(args: Mapping[str, str]) -> bytes:
    trigger = _choice(args, "trigger", TRIGGERS, "ontime")
    if trigger != TRIGGERS["ontime"] and "period" in args:
        raise ValueError(f"period = {args['period']!r}: only trigger ontime has one")
    period = check_period(_number(args, "period")) if trigger == TRIGGERS["ontime"] else 0.0
    return LOG.pack(_choice(args, "port", PORTS, "thisport"), _message(args), 0, 0, trigger, period, 0.0, 0)


def _reset(args: Mapping[str, str]) -> bytes:
    delay = _number(args, "delay") if "delay" in args else 0.0
    if not 0 <= delay <= MAX_DELAY or delay != int(delay):
        raise ValueError(f"delay = {args['delay']!r}: must be whole seconds from 0 to {MAX_DELAY}")
    return ONE.pack(int(delay))


_BODIES: dict[str, Callable[[Mapping[str, str]], bytes]] = {
    "log": _log,
    "unlog": lambda args: UNLOG.pack(_choice(args, "port", PORTS, "thisport"), _message(args), 0, 0),
    "unlogall": lambda args: UNLOGALL.pack(_choice(args, "port", GROUPS, "thisport"), 0),
    "reset": _reset,
    "antennapower": lambda args: ONE.pack(_choice(args, "state", SWITCH)),
}


def periodic_log_request(message: str, period: float) -> bytes:
    """LOG in ASCII form, of a message every ``period`` seconds; 0: at every change.

    In ASCII, so that its ASCII answer differs from answers to binary commands of users.
    """
    name = messages.NAMES[messages.number_of(message)]
    trigger = "ONTIME" if period else "ONCHANGED"
    return encode_text(f"{ASCII_LOG};THISPORT,{name}B,{trigger},{period:.6f},0.000000,NOHOLD")


# ------------------------------------------------------------------------------------------------------- answers


def decode_answer(header: NovatelHeader, body: bytes, stamp: Stamp) -> list[Ack]:
    """The answer to a binary command; none for unknown commands."""
    name = NAMES.get(header.message_id)
    if name is None or len(body) < ONE.size:
        return []
    code = ONE.unpack_from(body)[0]
    text = body[ONE.size :].split(b"\0")[0].decode("ascii", errors="replace")
    return [Ack(stamp=stamp, command=name, accepted=code == CODE_OK, detail=text or f"code {code}")]


def decode_abbreviated(line: bytes, stamp: Stamp) -> list[Ack]:
    """``<OK`` or ``<ERROR:text``; it does not identify the command."""
    text = line[1:].strip().decode("ascii")
    return [Ack(stamp=stamp, command="", accepted=text == "OK", detail=text.removeprefix("ERROR:"))]


def decode_ascii_answer(line: bytes, stamp: Stamp) -> list[Ack] | None:
    """``#LOGR,...;OK*crc``: a refusal; None for other ASCII messages.

    The acceptance of repeated requests is not reported.
    """
    head, _, rest = line[1:].decode("ascii").partition(";")
    name = head.partition(",")[0]
    if not name.endswith("R") or name[:-1].lower() not in COMMANDS:
        return None
    text = rest.rpartition("*")[0].strip('"')
    return [] if text == "OK" else [Ack(stamp=stamp, command=name[:-1].lower(), accepted=False, detail=text)]


def encode_answer(header: NovatelHeader, message_id: int, code: int, text: str) -> bytes:
    """The receiver's answer to a binary command; header : with its time and status."""
    header = header._replace(message_id=message_id, message_type=RESPONSE_BIT)
    return encode_frame(header, ONE.pack(code) + text.encode("ascii"))
