"""Commands of an HMR2300: ``*ddX`` and carriage return; dd is the device (00 to 98; 99: all).

A command that changes a setting must follow a write enable (``*ddWE``) and consumes it; otherwise the answer is "WE
OFF".  ``enable`` "together" sends both at once.  On a two-wire line the OK of the device would collide with the second
part: there ``enable`` is "apart", and ``write_enable`` is a separate command before each.

    A, B                ASCII ON, BINARY ON      R=nnn          OK          TN TF           S/R ON, S/R OFF
    P, C, Esc           samples, none            ID=nn          OK          ]S ]R           SET, RST
    ZN ZF               ZERO ON, ZERO OFF        Q              settings    # F H           SER#, S/W vers:, H/W vers:
    VN VF               AVG ON, AVG OFF          *99ID=         ID= nn      *99!BR=S, F     OK, BAUD= 9600, 19,200
    Y N                 OK                       D, RST         OK, BAUD=   SP              DONE, OK
    unknown command, or more than ten characters after the asterisk: Re-enter
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from fti.config import Positive, StrictModel
from fti.config.keys import NO_UNIT, key
from fti.drivers import Command
from fti.drivers._arguments import check_names

RATES = (10, 20, 25, 30, 40, 50, 60, 100, 123, 154)
BROADCAST_ID = 99
ESCAPE = b"\x1b"
SWITCH = {"on": "N", "off": "F"}

COMMANDS: Mapping[str, Command] = {
    "write_enable": Command("permit the next command that changes a setting (if enable = apart)"),
    "format": Command("form of the samples", {"format": "binary or ascii"}),
    "rate": Command("samples in continuous mode", {"samples_per_s": f"one of {', '.join(map(str, RATES))}"}),
    "continuous": Command("send samples continuously", answered=False),
    "stop": Command("stop the samples of continuous mode", answered=False),
    "sample": Command("send one sample", answered=False),
    "set_reset_mode": Command("set and reset pulses before each sample, which remove its offset",
                              {"state": "on or off"}),
    "set_reset_pulse": Command("one pulse; the next three samples are not valid", {"pulse": "set or reset"}),
    "zero": Command("subtract the present field from all samples", {"state": "on or off"}),
    "average": Command("running average, each sample with half the weight of the next", {"state": "on or off"}),
    "re_enter": Command("answer to unknown commands", {"state": "on or off"}),
    "identify": Command("request the number of the device (all answer)"),
    "set_id": Command("set the number of the device", {"id": "0 to 98"}),
    "baud": Command("baud rate of all devices; change that of the link as well", {"baud": "9600 or 19200"}),
    "query": Command("request the settings"),
    "serial_number": Command("request the serial number"),
    "software_version": Command("request the software version"),
    "hardware_version": Command("request the hardware version"),
    "default": Command("restore the factory settings, including the baud rate"),
    "restore": Command("restore the stored settings"),
    "store": Command("store the settings in non-volatile memory"),
}  # fmt: skip
#: Commands without arguments: letters.
PLAIN = {
    "write_enable": "WE",
    "continuous": "C",
    "sample": "P",
    "query": "Q",
    "serial_number": "#",
    "software_version": "F",
    "hardware_version": "H",
    "default": "D",
    "restore": "RST",
    "store": "SP",
}
QUERIES = frozenset({"write_enable", "continuous", "sample", "query", "serial_number", "software_version",
                     "hardware_version", "set_reset_pulse"})  # fmt: skip
#: Values of an argument and their letters.
CHOICES: dict[str, tuple[str, dict[str, str]]] = {
    "format": ("format", {"binary": "B", "ascii": "A"}),
    "rate": ("samples_per_s", {str(rate): f"R={rate}" for rate in RATES}),
    "set_reset_mode": ("state", {"on": "TN", "off": "TF"}),
    "set_reset_pulse": ("pulse", {"set": "]S", "reset": "]R"}),
    "zero": ("state", {"on": "ZN", "off": "ZF"}),
    "average": ("state", {"on": "VN", "off": "VF"}),
    "re_enter": ("state", {"on": "Y", "off": "N"}),
    "set_id": ("id", {str(number): f"ID={number:02d}" for number in range(BROADCAST_ID)}),
    "baud": ("baud", {"9600": "!BR=S", "19200": "!BR=F"}),
}


class Options(StrictModel):
    """Options of a magnetometer."""

    id: Annotated[int, Field(ge=0, le=BROADCAST_ID), key("number of the device; 99: every device", NO_UNIT)] = 0
    mode: Annotated[
        Literal["polled", "continuous"],
        key("polled: a sample is requested every poll_s; continuous: the device sends at rate", NO_UNIT),
    ] = "polled"
    format: Annotated[Literal["binary", "ascii"], key("format of the samples, set after every connect", NO_UNIT)] = (
        "binary"
    )
    rate: Annotated[
        Literal[10, 20, 25, 30, 40, 50, 60, 100, 123, 154],
        key(
            "in continuous mode: rate of the samples; above 30 (ascii) or 100 (binary) the line needs 19200 bit/s", "Hz"
        ),
    ] = 20
    poll_s: Annotated[Positive, key("in polled mode: period of the requests", "s")] = 0.05
    enable: Annotated[
        Literal["together", "apart"],
        key("write enable: sent together with each command, or apart, as two-wire lines need", NO_UNIT),
    ] = "together"


def line(device: int, letters: str) -> bytes:
    """A command on the wire."""
    return f"*{device:02d}{letters}\r".encode("ascii")


def on_connect(options: Options) -> list[bytes]:
    """Stop samples, set format (and rate), and restart in continuous mode."""
    settings = [CHOICES["format"][1][options.format]]
    if options.mode == "continuous":
        settings.insert(0, f"R={options.rate}")  # the format last: its answer precedes the first sample
    setup = [line(options.id, letters) for setting in settings for letters in ("WE", setting)]
    return [ESCAPE, *setup] + ([line(options.id, "C")] if options.mode == "continuous" else [])


def poll(options: Options) -> tuple[float, bytes] | None:
    """Request one sample."""
    return (options.poll_s, line(options.id, "P")) if options.mode == "polled" else None


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The bytes of a command.  Raises ValueError."""
    check_names(COMMANDS, name, args)
    options = options or Options()
    letters = _letters(name, args)
    if name == "stop":
        return ESCAPE
    if name == "identify":
        return line(BROADCAST_ID, "ID=")
    device = BROADCAST_ID if name == "baud" else options.id
    enabled = name in QUERIES or options.enable == "apart"
    return (b"" if enabled else line(device, "WE")) + line(device, letters)


def _letters(name: str, args: Mapping[str, str]) -> str:
    arguments = COMMANDS[name].arguments
    if name not in CHOICES:
        return PLAIN.get(name, "")
    key, choices = CHOICES[name]
    if key not in args:
        raise ValueError(f"{name}: {key} is missing: {arguments[key]}")
    if args[key] not in choices:
        raise ValueError(f"{name}: {key} = {args[key]!r}: must be {arguments[key]}")
    return choices[args[key]]
