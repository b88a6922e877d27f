"""Messages to an autopilot: COMMAND_LONG 76 and a heartbeat.  There are no commands for arming or flight control.

Frames are encoded independently, so their sequence number is always 0, and they are not signed: an autopilot that
requires signed commands refuses them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from pymavlink.dialects.v20 import common

from fti.config import Positive, StrictModel
from fti.drivers import Command
from fti.drivers._arguments import check_complete, number_or_nan
from fti.drivers.mavlink.wire import dialect_map

SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 511, 512
MAX_RATE_HZ = 1000.0
_MESSAGE = "name (ATTITUDE) or number (30) of a message of the dialect"
COMMANDS: Mapping[str, Command] = {
    "message_interval": Command(
        "set the rate of a message",
        {"message": _MESSAGE, "rate_hz": "above 0 to 1000 Hz; 0: default of the autopilot; off: stop"},
    ),
    "request_message": Command("send a message once", {"message": _MESSAGE}),
}


def _check_name(name: str) -> str:
    if all(message.msgname != name for message in dialect_map("common").values()):
        raise ValueError(f"{name!r} is not a message of MAVLink's common.xml")
    return name


class Options(StrictModel):
    """``system``, ``component``: decode only these; required for several vehicles on a link.

    ``height``, ``raw_imu``, ``key`` (64 hexadecimal digits), ``emulate``: see the driver's docstring.  ``dialect``:
    other messages are rejected.  ``only``: messages that become measurements; empty: all.  ``distance_id``: use only
    this distance sensor.  ``named_values``: names of NAMED_VALUE_FLOAT that become readings, in the unit of the sender.
    ``heartbeat_s``: period of our heartbeat; ``own_system``, ``own_component``: sender of our heartbeat and commands.
    """

    system: Annotated[int, Field(ge=1, le=255)] | None = None
    component: Annotated[int, Field(ge=1, le=255)] | None = None
    height: Literal["msl", "ellipsoid"] = "msl"
    raw_imu: Literal["counts", "scaled"] = "counts"
    only: tuple[Annotated[str, AfterValidator(_check_name)], ...] = ()
    distance_id: Annotated[int, Field(ge=0, le=255)] | None = None
    named_values: tuple[Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{1,10}$")], ...] = ()
    dialect: Literal["common", "ardupilotmega"] = "common"
    key: Annotated[str, Field(pattern=r"^\s*[0-9a-fA-F]{64}\s*$")] | None = None
    heartbeat_s: Positive | None = None
    own_system: Annotated[int, Field(ge=1, le=255)] = 255
    own_component: Annotated[int, Field(ge=1, le=255)] = 190
    emulate: Literal["autopilot", "simulator"] = "autopilot"


def _pack(message: Any, options: Options) -> bytes:
    sender = common.MAVLink(None, srcSystem=options.own_system, srcComponent=options.own_component)
    return bytes(message.pack(sender))


def poll(options: Options) -> tuple[float, bytes] | None:
    """A heartbeat of a ground station, if configured."""
    if options.heartbeat_s is None:
        return None
    ours = common.MAVLink_heartbeat_message(
        common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID, 0, 0, common.MAV_STATE_ACTIVE, 3
    )
    return options.heartbeat_s, _pack(ours, options)


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The bytes of a command.  Raises ValueError."""
    check_complete(COMMANDS, name, args)
    options = options or Options()
    number = _number(name, args["message"], options.dialect)
    if name == "request_message":
        return _long(REQUEST_MESSAGE, number, 0.0, options)
    if args["rate_hz"] == "off":
        return _long(SET_MESSAGE_INTERVAL, number, -1.0, options)
    rate = number_or_nan(args["rate_hz"])
    if not 0.0 <= rate <= MAX_RATE_HZ:
        raise ValueError(f"message_interval: rate_hz = {args['rate_hz']!r}: must be 0 to {MAX_RATE_HZ:g}, or off")
    return _long(SET_MESSAGE_INTERVAL, number, float(round(1e6 / rate)) if rate else 0.0, options)


def _long(number: int, first: float, second: float, options: Options) -> bytes:
    """COMMAND_LONG; of SET_MESSAGE_INTERVAL the second parameter is the interval [us], -1 off, 0 default."""
    target = (options.system or 1, options.component or common.MAV_COMP_ID_AUTOPILOT1)
    return _pack(common.MAVLink_command_long_message(*target, number, 0, first, second, 0, 0, 0, 0, 0), options)


def _number(name: str, text: str, dialect: str) -> int:
    messages = dialect_map(dialect)
    if text.isascii() and text.isdigit() and int(text) in messages:
        return int(text)
    for number, message in messages.items():
        if message.msgname == text.upper():
            return number
    raise ValueError(f"{name}: message = {text!r}: must be the {_MESSAGE} {dialect}")
