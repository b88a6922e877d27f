"""Commands: which messages at which rate, the rate of measurement, reset, version.

They change what the receiver holds in its working memory, never what it has stored.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from fti.config import StrictModel
from fti.drivers import Command
from fti.drivers._arguments import check_names
from fti.drivers.ublox_ubx.frames import frame
from fti.drivers.ublox_ubx.table import OUTPUTS, PORTS

CFG_MSG, CFG_RST, CFG_RATE, CFG_VALSET, MON_VER = (0x06, 0x01), (0x06, 0x04), (0x06, 0x08), (0x06, 0x8A), (0x0A, 0x04)
RATE_MEAS, RATE_NAV = 0x30210001, 0x30210002
IN_RAM = 1
GPS_TIME = 1
MAX_KEYS = 64
#: What is forgotten: nothing, the ephemeris, everything.
RESET_MASKS = {"hot": 0x0000, "warm": 0x0001, "cold": 0xFFFF}
#: Only the satellite part is reset: the port stays open and keeps the messages that were asked for.
GNSS_ONLY = 0x02

COMMANDS: Mapping[str, Command] = {
    "message": Command(
        "send a message with every n-th solution, or no more",
        {"name": f"one of {', '.join(OUTPUTS)}", "rate": "0..255: every n-th solution; 0 = off; default 1"},
    ),
    "rate": Command(
        "how often to measure, and to solve",
        {"period_ms": "25..65535 ms between measurements", "cycles": "1..127 measurements per solution; default 1"},
    ),
    "reset": Command(
        "start again: hot, warm (ephemeris forgotten) or cold (everything forgotten); there is no fix for a while",
        {"kind": "hot, warm or cold"},
        answered=False,
    ),
    "version": Command("ask for the versions of hardware and software"),
}


def _known(messages: Mapping[str, int]) -> Mapping[str, int]:
    for name, rate in messages.items():
        if name not in OUTPUTS:
            raise ValueError(f"{name!r} is no message that can be asked for; there are {', '.join(OUTPUTS)}")
        if not 0 <= rate <= 255:
            raise ValueError(f"{name}: {rate} must be 0..255 (every n-th solution; 0 = off)")
    return messages


class Options(StrictModel):
    """How the receiver is asked.

    messages : {name: every n-th solution}, asked for after every connect, with the version; nothing is asked when
        empty.  period_ms : between measurements, set after every connect; None leaves it
    ask_again_s : the same again and again, for a receiver that was switched off and on; 0 is never.  Each time it
        acknowledges every message
    configure_with : cfg_msg up to u-blox 9, cfg_valset from u-blox 9 on; port : of the receiver, for cfg_valset
    """

    messages: Annotated[dict[str, int], AfterValidator(_known)] = Field(default={})
    period_ms: Annotated[int, Field(ge=25, le=65535)] | None = None
    ask_again_s: Annotated[float, Field(ge=0.0, le=3600.0)] = 0.0
    configure_with: Literal["cfg_msg", "cfg_valset"] = "cfg_msg"
    port: Literal["i2c", "uart1", "uart2", "usb", "spi"] = "uart1"


def on_connect(options: Options) -> list[bytes]:
    """The version, the messages and the period that the options ask for."""
    if not options.messages and options.period_ms is None:
        return []
    asked = [frame(*MON_VER, b"")]
    if options.period_ms is not None:
        asked.append(_measure_every(options.period_ms, 1, options))
    return asked + list(_request_messages(options.messages, options))


def poll(options: Options) -> tuple[float, bytes] | None:
    """The same again, when the options ask for it."""
    asked = b"".join(on_connect(options))
    return (options.ask_again_s, asked) if asked and options.ask_again_s else None


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The bytes of a command."""
    check_names(COMMANDS, name, args)
    return _MAKERS[name](args, options or Options())


def _message(args: Mapping[str, str], options: Options) -> bytes:
    wanted = _choice("message", "name", args, OUTPUTS)
    rate = _number("message", "rate", args, range(256), default=1)
    return next(_request_messages({wanted: rate}, options))


def _rate(args: Mapping[str, str], options: Options) -> bytes:
    period_ms = _number("rate", "period_ms", args, range(25, 65536))
    return _measure_every(period_ms, _number("rate", "cycles", args, range(1, 128), default=1), options)


def _reset(args: Mapping[str, str], options: Options) -> bytes:
    kind = _choice("reset", "kind", args, RESET_MASKS)
    return frame(*CFG_RST, struct.pack("<HBx", RESET_MASKS[kind], GNSS_ONLY))


def _version(args: Mapping[str, str], options: Options) -> bytes:
    return frame(*MON_VER, b"")


_MAKERS = {"message": _message, "rate": _rate, "reset": _reset, "version": _version}


def _choice(name: str, key: str, args: Mapping[str, str], allowed: Mapping[str, object]) -> str:
    given = args.get(key)
    if given is None or given not in allowed:
        said = "is missing" if given is None else f"= {given!r}"
        raise ValueError(f"{name}: {key} {said}; allowed: {', '.join(allowed)}")
    return given


def _number(name: str, key: str, args: Mapping[str, str], allowed: range, default: int | None = None) -> int:
    given = args.get(key)
    if given is None and default is not None:
        return default
    if given is None or not given.isascii() or not given.isdigit() or int(given) not in allowed:
        said = "is missing" if given is None else f"= {given!r}"
        raise ValueError(f"{name}: {key} {said}; allowed: a whole number, {allowed[0]}..{allowed[-1]}")
    return int(given)


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
