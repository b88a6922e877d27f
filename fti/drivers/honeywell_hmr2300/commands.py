"""What an HMR2300 can be told: ``*ddX`` and carriage return, dd the device (00 to 98; 99 all).

A command that changes a setting must follow a write enable (``*ddWE``) and uses it up; otherwise the answer is
"WE OFF".  ``enable`` "together" sends both in one go.  On a line of two wires the device's OK would meet our second
half: there ``enable`` is "apart", and ``write_enable`` is sent as a command of its own before each.

    A, B                ASCII ON, BINARY ON      R=nnn          OK          TN TF           S/R ON, S/R OFF
    P, C, Esc           samples, none            ID=nn          OK          ]S ]R           SET, RST
    ZN ZF               ZERO ON, ZERO OFF        Q              settings    # F H           SER#, S/W vers:, H/W vers:
    VN VF               AVG ON, AVG OFF          *99ID=         ID= nn      *99!BR=S, F     OK, BAUD= 9600, 19,200
    Y N                 OK                       D, RST         OK, BAUD=   SP              DONE, OK
    not understood, or more than ten characters behind the asterisk: Re-enter
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from fti.config import Positive, StrictModel
from fti.drivers import Command
from fti.drivers._arguments import check_names

RATES = (10, 20, 25, 30, 40, 50, 60, 100, 123, 154)
BROADCAST_ID = 99
ESCAPE = b"\x1b"
SWITCH = {"on": "N", "off": "F"}

COMMANDS: Mapping[str, Command] = {
    "write_enable": Command("permit the next command that changes a setting (where enable = apart)"),
    "format": Command("form of the samples", {"format": "binary or ascii"}),
    "rate": Command("samples in continuous mode", {"samples_per_s": f"one of {', '.join(map(str, RATES))}"}),
    "continuous": Command("send samples continuously", answered=False),
    "stop": Command("stop the samples of continuous mode", answered=False),
    "sample": Command("send one sample", answered=False),
    "set_reset_mode": Command("set and reset pulses before each sample, which keep its offset away",
                              {"state": "on or off"}),
    "set_reset_pulse": Command("one pulse; the next three samples are not valid", {"pulse": "set or reset"}),
    "zero": Command("subtract the field of this moment from all samples", {"state": "on or off"}),
    "average": Command("running average, each sample with half the weight of the next", {"state": "on or off"}),
    "re_enter": Command("the answer to what is not understood", {"state": "on or off"}),
    "identify": Command("which device is on the line (all answer)"),
    "set_id": Command("give the device a number", {"id": "0 to 98"}),
    "baud": Command("speed of the line, of all devices; the link must follow", {"baud": "9600 or 19200"}),
    "query": Command("the settings"),
    "serial_number": Command("the serial number"),
    "software_version": Command("the version of the software"),
    "hardware_version": Command("the version of the hardware"),
    "default": Command("the settings of the factory, speed of the line included"),
    "restore": Command("the settings that were stored last"),
    "store": Command("keep the settings when the power goes"),
}  # fmt: skip
#: Commands without arguments: letters; those that need no write enable.
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
#: Argument's values and the letters they stand for.
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
    """``id``: the device, 99 all; ``mode``, ``format``, ``rate``, ``poll_s``: how it is set and asked.

    ``enable``: a write enable goes "together" with each command, or "apart" (two wires).
    """

    id: Annotated[int, Field(ge=0, le=BROADCAST_ID)] = 0
    mode: Literal["polled", "continuous"] = "polled"
    format: Literal["binary", "ascii"] = "binary"
    rate: Literal[10, 20, 25, 30, 40, 50, 60, 100, 123, 154] = 20
    poll_s: Positive = 0.05
    enable: Literal["together", "apart"] = "together"


def line(device: int, letters: str) -> bytes:
    """A command as it goes over the line."""
    return f"*{device:02d}{letters}\r".encode("ascii")


def on_connect(options: Options) -> list[bytes]:
    """Stop what is running, set format (and rate), and start again in continuous mode."""
    settings = [CHOICES["format"][1][options.format]]
    if options.mode == "continuous":
        settings.insert(0, f"R={options.rate}")  # the format last: its answer says where the samples begin
    told = [line(options.id, letters) for setting in settings for letters in ("WE", setting)]
    return [ESCAPE, *told] + ([line(options.id, "C")] if options.mode == "continuous" else [])


def poll(options: Options) -> tuple[float, bytes] | None:
    """One sample."""
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
    wanted = COMMANDS[name].arguments
    if name not in CHOICES:
        return PLAIN.get(name, "")
    key, choices = CHOICES[name]
    if key not in args:
        raise ValueError(f"{name}: {key} is missing: {wanted[key]}")
    if args[key] not in choices:
        raise ValueError(f"{name}: {key} = {args[key]!r}: must be {wanted[key]}")
    return choices[args[key]]
