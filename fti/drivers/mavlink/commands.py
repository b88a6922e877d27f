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
from fti.config.keys import NO_UNIT
from fti.config.keys import key as table_key  # an option has the name key
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
    """Options of an autopilot."""

    system: Annotated[
        Annotated[int, Field(ge=1, le=255)] | None,
        table_key("decode only this system; required for several vehicles on a link; none: every system", NO_UNIT, 1),
    ] = None
    component: Annotated[
        Annotated[int, Field(ge=1, le=255)] | None,
        table_key("decode only this component; none: every component", NO_UNIT, 1),
    ] = None
    height: Annotated[
        Literal["msl", "ellipsoid"],
        table_key("datum of the altitude in GLOBAL_POSITION_INT; msl by the standard", NO_UNIT),
    ] = "msl"
    raw_imu: Annotated[
        Literal["counts", "scaled"],
        table_key("numbers in RAW_IMU; counts: without a unit; scaled: mG, mrad/s and mgauss", NO_UNIT),
    ] = "counts"
    only: Annotated[
        tuple[Annotated[str, AfterValidator(_check_name)], ...],
        table_key("messages that become measurements; empty: all", NO_UNIT, ["GPS_RAW_INT"]),
    ] = ()
    distance_id: Annotated[
        Annotated[int, Field(ge=0, le=255)] | None,
        table_key("use only the distance sensor with this id; none: of those that look down the lowest id", NO_UNIT, 1),
    ] = None
    named_values: Annotated[
        tuple[Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{1,10}$")], ...],
        table_key("names of NAMED_VALUE_FLOAT that become readings, in the unit of the sender", NO_UNIT, ["dh"]),
    ] = ()
    dialect: Annotated[
        Literal["common", "ardupilotmega"], table_key("message definitions; other messages are rejected", NO_UNIT)
    ] = "common"
    key_file: Annotated[
        str | None, table_key("file of the key of the signatures; none: the key in key", NO_UNIT, "mavlink.key")
    ] = None
    key: Annotated[
        Annotated[str, Field(pattern=r"^\s*[0-9a-fA-F]{64}\s*$")] | None,
        table_key(
            "key of the signatures, or filled in from key_file; none: signatures are not checked", NO_UNIT, "00" * 32
        ),
    ] = None
    heartbeat_s: Annotated[
        Positive | None, table_key("period of the heartbeat of a ground station; none: no heartbeat is sent", "s", 1.0)
    ] = None
    own_system: Annotated[
        int, Field(ge=1, le=255), table_key("system number of the sender of heartbeats and commands", NO_UNIT)
    ] = 255
    own_component: Annotated[
        int, Field(ge=1, le=255), table_key("component number of the sender of heartbeats and commands", NO_UNIT)
    ] = 190
    emulate: Annotated[
        Literal["autopilot", "simulator"],
        table_key(
            "messages of the emulated device: of an autopilot, or of a simulator for one (HIL_SENSOR, HIL_GPS)", NO_UNIT
        ),
    ] = "autopilot"


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
