r"""Power distribution unit of the laboratory: a circuit breaker for each device, over a serial line or UDP.

Document: this docstring.  The protocol is our own, for the emulated power unit, which is modelled on the one beside the
interface cabinet (Spiegel 2018, section 6.5, figure 6.16).  A unit in an aircraft has another protocol and needs its
own driver.

Sentences of NMEA 0183: ``$``, fields, ``*``, exclusive or of the characters between as two hexadecimal digits, CR LF.

    $PFTI,BRK,<breaker>,<state>,<current>*hh            each breaker, at the rate of the unit; current [A], 2 decimals
    $PFTI,PDU,<voltage>,<current>,<count>*hh            after them: supply [V], total current [A], number of breakers
    $PFTI,SET,<command>,<breaker>*hh                    to the unit: on, off, trip, reset
    $PFTI,ACK,<command>,<breaker>,<0 or 1>,<words>*hh   its answer: 1 done; text

    state   on          the device has power and has started
            starting    the device has power and is starting
            off         switched off by command
            tripped     opened by an overload; open until reset
            brown_out   closed, but the supply voltage is too low for the device

A breaker has the name of the device that it feeds.  The unit feeds itself and has none.

A ``DeviceStatus`` follows when the number of received breakers equals that of PDU; it is ok when all are on, and a flag
names each other one: ``altimeter_tripped``.  ``Reading`` of a breaker: its current, and its state as ``text``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from fti.config import StrictModel
from fti.drivers import Command, Counters
from fti.drivers._arguments import check_complete
from fti.drivers._framing import FramedDecoder, Framer, Skip, skip_to
from fti.drivers._nmea_framing import MAX_SENTENCE, measure_sentence, split
from fti.drivers._no_commands import on_connect, poll  # noqa: F401 - the unit sends by itself
from fti.formats.nmea_fields import sentence
from fti.messages.measurements import Ack, DeviceStatus, Measurement, Reading, Stamp

DOCUMENT = "our own protocol for the laboratory: docstring of fti/drivers/power_unit.py"
MESSAGES = {
    "breaker": "state and current of a breaker",
    "supply": "voltage and current of the unit",
    "answer": "answer of the unit to a command",
    "(other)": "a sentence of another kind, or one whose fields are wrong",
}
CARRIERS = frozenset({"serial", "udp"})

START = b"$PFTI,"
STATES = ("on", "starting", "off", "tripped", "brown_out")
VOLTAGE, CURRENT = "supply_voltage", "supply_current"
MAX_NAME_LENGTH, MAX_TEXT_LENGTH = 64, 60
NUMBER = r"(\d{1,4}\.\d\d)"
BREAKER = r"([a-z][a-z0-9_]{0,63})"
BRK = re.compile(rf"PFTI,BRK,{BREAKER},({'|'.join(STATES)}),{NUMBER}")
PDU = re.compile(rf"PFTI,PDU,{NUMBER},{NUMBER},(\d{{1,3}})")
SET = re.compile(rf"PFTI,SET,(on|off|trip|reset),{BREAKER}")
ACK = re.compile(rf"PFTI,ACK,(on|off|trip|reset),{BREAKER},([01]),([^,]{{0,{MAX_TEXT_LENGTH}}})")

BREAKER_ARGUMENT = {"breaker": "name of the device that it feeds"}
COMMANDS: Mapping[str, Command] = {
    "off": Command("switch a breaker off", BREAKER_ARGUMENT),
    "on": Command("switch a breaker on that is off", BREAKER_ARGUMENT),
    "trip": Command("open a breaker as an overload does", BREAKER_ARGUMENT),
    "reset": Command("close a breaker that has tripped", BREAKER_ARGUMENT),
}

#: Executes (command, breaker); returns whether it succeeded, and a text.
CommandHandler = Callable[[str, str], tuple[bool, str]]


class Options(StrictModel):
    """There are none."""


class Decoder(FramedDecoder):
    """Sentences of the unit to Reading, DeviceStatus and Ack."""

    def __init__(self, options: Options) -> None:
        super().__init__(_measure, MAX_SENTENCE)
        self._states: dict[str, str] = {}  # of the breakers received since the last PDU

    def _decode(self, frame: bytes, t_rx_ns: int) -> tuple[str, list[Measurement]]:
        text, stamp = ",".join(split(frame)), Stamp(t_rx_ns)
        if m := BRK.fullmatch(text):
            self._states[m[1]] = m[2]
            return "breaker", [Reading(stamp=stamp, name=m[1], value=float(m[3]), unit="A", text=m[2])]
        if m := PDU.fullmatch(text):
            return "supply", [*self._status(int(m[3]), stamp), *decode_supply(float(m[1]), float(m[2]), stamp)]
        if m := ACK.fullmatch(text):
            return "answer", [Ack(stamp=stamp, command=m[1], accepted=m[3] == "1", detail=f"{m[2]}: {m[4]}")]
        return "(other)", []

    def _status(self, count: int, stamp: Stamp) -> list[Measurement]:
        """The state of all breakers; none if some are missing."""
        states, self._states = self._states, {}
        if len(states) != count:
            return []
        flags = tuple(f"{name}_{state}" for name, state in states.items() if state != "on")
        return [DeviceStatus(stamp=stamp, ok=not flags, flags=flags)]


def _measure(buffer: bytearray) -> int | Skip:
    return skip_to(buffer, START) or measure_sentence(buffer)


def decode_supply(volts: float, amps: float, stamp: Stamp) -> list[Measurement]:
    """Voltage [V] and current [A] of the supply."""
    return [
        Reading(stamp=stamp, name=VOLTAGE, value=volts, unit="V"),
        Reading(stamp=stamp, name=CURRENT, value=amps, unit="A"),
    ]


def refuse(command: str, breaker: str) -> tuple[bool, str]:
    """Command handler of a unit without breakers."""
    return False, f"unknown breaker {breaker}"


class Encoder:
    """The emulated unit.  ``handle_command`` : executes commands; the default refuses all of them."""

    def __init__(self, options: Options) -> None:
        self.handle_command: CommandHandler = refuse
        self._volts, self._count = 0.0, 0
        self._command_framer = Framer(_measure, Counters(), limit=MAX_SENTENCE)

    def encode(self, measurement: Measurement) -> list[bytes]:
        if not isinstance(measurement, Reading):
            return []
        if measurement.name == VOLTAGE:
            self._volts = measurement.value or 0.0
            return []
        amps = measurement.value or 0.0
        if measurement.name == CURRENT:
            count, self._count = self._count, 0
            return [sentence(f"PFTI,PDU,{self._volts:.2f},{amps:.2f},{count}")]
        self._count += 1
        return [sentence(f"PFTI,BRK,{measurement.name},{measurement.text},{amps:.2f}")]

    def respond(self, data: bytes) -> list[bytes]:
        commands = (SET.fullmatch(",".join(split(frame))) for _, frame in self._command_framer.feed(data, 0))
        return [self._answer(match[1], match[2]) for match in commands if match]

    def _answer(self, name: str, breaker: str) -> bytes:
        done, words = self.handle_command(name, breaker)
        return sentence(f"PFTI,ACK,{name},{breaker},{done:d},{words[:MAX_TEXT_LENGTH]}")


make_decoder, make_encoder = Decoder, Encoder


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The sentence of a command.  Raises ValueError."""
    check_complete(COMMANDS, name, args)
    breaker = args["breaker"]
    if not re.fullmatch(BREAKER, breaker):
        raise ValueError(
            f"{name}: breaker = {breaker!r}: must be the name of a device, {MAX_NAME_LENGTH} characters at most"
        )
    return sentence(f"PFTI,SET,{name},{breaker}")
