"""Commands: which messages at which rate, the rate of measurement, reset, version.

They change the RAM configuration of the receiver, never the stored one.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.drivers import Command
from fti.drivers._arguments import check_names
from fti.drivers.ublox_ubx.frames import frame
from fti.drivers.ublox_ubx.table import OUTPUTS, PORTS

CFG_MSG, CFG_RST, CFG_RATE, CFG_VALSET, MON_VER = (0x06, 0x01), (0x06, 0x04), (0x06, 0x08), (0x06, 0x8A), (0x0A, 0x04)
RATE_MEAS, RATE_NAV = 0x30210001, 0x30210002
IN_RAM = 1
GPS_TIME = 1
MAX_KEYS = 64
#: Deleted data: none, ephemeris, everything.
RESET_MASKS = {"hot": 0x0000, "warm": 0x0001, "cold": 0xFFFF}
#: Resets only the GNSS part: the port stays open and keeps the requested messages.
GNSS_ONLY = 0x02

COMMANDS: Mapping[str, Command] = {
    "message": Command(
        "set the rate of a message",
        {"name": f"one of {', '.join(OUTPUTS)}", "rate": "0..255: every n-th solution; 0 = off; default 1"},
    ),
    "rate": Command(
        "set the measurement and solution rates",
        {"period_ms": "25..65535 ms between measurements", "cycles": "1..127 measurements per solution; default 1"},
    ),
    "reset": Command(
        "restart: hot, warm (deletes the ephemeris) or cold (deletes everything); there is no fix for a while",
        {"kind": "hot, warm or cold"},
        answered=False,
    ),
    "version": Command("request the versions of hardware and software"),
}


def _check_messages(messages: Mapping[str, int]) -> Mapping[str, int]:
    for name, rate in messages.items():
        if name not in OUTPUTS:
            raise ValueError(f"{name!r} cannot be requested; there are {', '.join(OUTPUTS)}")
        if not 0 <= rate <= 255:
            raise ValueError(f"{name}: {rate} must be 0..255 (every n-th solution; 0 = off)")
    return messages


class Options(StrictModel):
    """Options of a u-blox receiver."""

    messages: Annotated[
        dict[str, int],
        AfterValidator(_check_messages),
        key(
            "messages that are requested after every connect, with the version: each every n-th solution, 0 to 255, 0: "
            "off; empty: no requests",
            ONE,
            {"NAV-PVT": 1, "NAV-SAT": 5},
        ),
    ] = Field(default={})
    period_ms: Annotated[
        Annotated[int, Field(ge=25, le=65535)] | None,
        key("period of the measurements, set after every connect; none: unchanged", "ms", 200),
    ] = None
    ask_again_s: Annotated[
        float,
        Field(ge=0.0, le=3600.0),
        key("period of repeated requests, for a receiver that was restarted; 0: only after a connect", "s"),
    ] = 0.0
    configure_with: Annotated[
        Literal["cfg_msg", "cfg_valset"],
        key("requests of the receiver: cfg_msg up to u-blox 9, cfg_valset from u-blox 9 on", NO_UNIT),
    ] = "cfg_msg"
    port: Annotated[
        Literal["i2c", "uart1", "uart2", "usb", "spi"],
        key("with cfg_valset: port of the receiver to which the link is connected", NO_UNIT),
    ] = "uart1"


def on_connect(options: Options) -> list[bytes]:
    """Requests of the version, the period and the messages of the options."""
    if not options.messages and options.period_ms is None:
        return []
    requests = [frame(*MON_VER, b"")]
    if options.period_ms is not None:
        requests.append(_measure_every(options.period_ms, 1, options))
    return requests + list(_request_messages(options.messages, options))


def poll(options: Options) -> tuple[float, bytes] | None:
    """The same periodically, if configured."""
    requests = b"".join(on_connect(options))
    return (options.ask_again_s, requests) if requests and options.ask_again_s else None


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The bytes of a command."""
    check_names(COMMANDS, name, args)
    return _MAKERS[name](args, options or Options())


def _message(args: Mapping[str, str], options: Options) -> bytes:
    name = _choice("message", "name", args, OUTPUTS)
    rate = _number("message", "rate", args, range(256), default=1)
    return next(_request_messages({name: rate}, options))


def _rate(args: Mapping[str, str], options: Options) -> bytes:
    period_ms = _number("rate", "period_ms", args, range(25, 65536))
    return _measure_every(period_ms, _number("rate", "cycles", args, range(1, 128), default=1), options)


def _reset(args: Mapping[str, str], options: Options) -> bytes:
    kind = _choice("reset", "kind", args, RESET_MASKS)
    return frame(*CFG_RST, struct.pack("<HBx", RESET_MASKS[kind], GNSS_ONLY))


_MAKERS: dict[str, Callable[[Mapping[str, str], Options], bytes]] = {
    "message": _message,
    "rate": _rate,
    "reset": _reset,
    "version": lambda _args, _options: frame(*MON_VER, b""),
}


def _choice(name: str, key: str, args: Mapping[str, str], allowed: Mapping[str, object]) -> str:
    text = args.get(key)
    if text is None or text not in allowed:
        problem = "is missing" if text is None else f"= {text!r}"
        raise ValueError(f"{name}: {key} {problem}; allowed: {', '.join(allowed)}")
    return text


def _number(name: str, key: str, args: Mapping[str, str], allowed: range, default: int | None = None) -> int:
    text = args.get(key)
    if text is None and default is not None:
        return default
    if text is None or not text.isascii() or not text.isdigit() or int(text) not in allowed:
        problem = "is missing" if text is None else f"= {text!r}"
        raise ValueError(f"{name}: {key} {problem}; allowed: a whole number, {allowed[0]}..{allowed[-1]}")
    return int(text)


# ------------------------------------------------------------------------------------------------- configuration


def _measure_every(period_ms: int, cycles: int, options: Options) -> bytes:
    if options.configure_with == "cfg_valset":
        return _set_values([struct.pack("<IH", RATE_MEAS, period_ms), struct.pack("<IH", RATE_NAV, cycles)])
    return frame(*CFG_RATE, struct.pack("<HHH", period_ms, cycles, GPS_TIME))


def _request_messages(messages: Mapping[str, int], options: Options) -> Iterator[bytes]:
    if options.configure_with == "cfg_msg":
        for name, rate in messages.items():
            yield frame(*CFG_MSG, bytes((*OUTPUTS[name][:2], rate)))
        return
    port = PORTS.index(options.port)
    values = [struct.pack("<IB", OUTPUTS[name][2] + port, rate) for name, rate in messages.items()]
    for at in range(0, len(values), MAX_KEYS):
        yield _set_values(values[at : at + MAX_KEYS])


def _set_values(values: list[bytes]) -> bytes:
    return frame(*CFG_VALSET, struct.pack("<BBxx", 0, IN_RAM) + b"".join(values))
