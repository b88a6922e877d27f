"""The emulated receiver: it sends the requested messages and answers commands.

The receiver is silent until messages are requested; with ``unasked`` it sends everything from the start.  It accepts
commands in all three forms (abbreviated: ``log bestposb ontime 0.1``), and answers in the same form.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple

from msgspec.structs import replace

from fti.constants import SECOND_NS
from fti.drivers import Counters
from fti.drivers._framing import Framer, Skip
from fti.drivers.novatel_oem6 import commands, messages
from fti.drivers.novatel_oem6.clock import FINE_STEERING, UTC_OFFSET, encode_clockmodel, encode_time
from fti.drivers.novatel_oem6.commands import TRIGGERS
from fti.drivers.novatel_oem6.framing import PLAIN_MAX, SYNC, NovatelHeader, encode_frame, encode_text, measure, split
from fti.drivers.novatel_oem6.observations import encode_range
from fti.drivers.novatel_oem6.sky import encode_psrdop, encode_satvis2
from fti.drivers.novatel_oem6.solution import encode_bestpos, encode_bestvel
from fti.drivers.novatel_oem6.status import encode_rxstatus, encode_words
from fti.formats.device_time import device_time_ns, gps_week
from fti.messages.measurements import (
    DeviceStatus,
    DeviceTime,
    Measurement,
    Position,
    Pseudoranges,
    Reading,
    ReceiverClock,
    Satellites,
    TimeScale,
    Velocity,
)

IDLE_TIME = 100  # 50 %
COM1 = commands.PORTS["com1"]
PROMPT = b"\r\n[COM1]"
UNPOWERED = "antenna_unpowered"
ONE_SHOT_TRIGGERS = frozenset({TRIGGERS["onnext"], TRIGGERS["once"]})

OK = (commands.CODE_OK, "OK")
NO_SUCH_LOG = (2, "Requested log does not exist")
INVALID_ID = (6, "Invalid Message ID")
INVALID_FIELD = (7, "Invalid Message. Field = 1")
INVALID_RATE = (21, "Requested rate is invalid")

Bodies = list[tuple[int, list[bytes]]]  # messages of a measurement: number, bodies
_LINE = re.compile(rb"[^\r\n]*[\r\n]+")


class LogRequest(NamedTuple):
    """Parameters of a LOG command; period_ns is 0 if there is none."""

    trigger: int
    period_ns: int


def measure_commands(buffer: bytearray) -> int | Skip:
    """Framing of data from the host: binary frames and lines."""
    if buffer[0] == SYNC[0]:
        return measure(buffer)
    line = _LINE.match(buffer)
    return line.end() if line else 0


class Encoder:
    """The emulated receiver."""

    def __init__(self, unasked: bool) -> None:
        self._unasked = unasked
        self._requests: dict[int, LogRequest] = {}
        self._turns: dict[int, int] = {}  # message -> period of its last transmission
        self._last_bodies: dict[int, list[bytes]] = {}
        self._status = 0
        self._powered = True
        self._used = 0
        self._now_ns = 0
        self._clock: ReceiverClock | None = None
        self._utc_offset: Reading | None = None
        self._framer = Framer(measure_commands, Counters(), limit=PLAIN_MAX)
        self._makers: dict[type, Callable[[Any], Bodies]] = {
            DeviceStatus: self._device_status,
            DeviceTime: lambda _: [(messages.TIME, [encode_time(self._clock, self._utc_offset, self._now_ns)])],
            Position: lambda m: [(messages.BESTPOS, [encode_bestpos(self._without_antenna(m), self._used)])],
            Pseudoranges: lambda m: [(messages.RANGE, [encode_range(m)])],
            Reading: self._reading,
            ReceiverClock: self._receiver_clock,
            Satellites: self._satellites,
            Velocity: lambda m: [(messages.BESTVEL, [encode_bestvel(self._without_antenna(m))])],
        }
        self._answers: dict[int, Callable[[bytes], tuple[int, str]]] = {
            messages.LOG: self._log,
            messages.UNLOG: self._unlog,
            messages.UNLOGALL: self._clear_requests,
            messages.RESET: self._clear_requests,
            messages.ANTENNAPOWER: self._power,
        }

    # ---------------------------------------------------------------------------------------------- measurements

    def encode(self, measurement: Measurement) -> list[bytes]:
        make = self._makers.get(type(measurement))
        if make is None:
            return []
        self._now_ns = device_time_ns(measurement.stamp, TimeScale.GPS)
        return [
            encode_frame(self._header(number, len(bodies) - 1 - i), body)
            for number, bodies in make(measurement)
            if bodies and self._is_due(number, bodies)
            for i, body in enumerate(bodies)
        ]

    def _header(self, number: int, sequence: int) -> NovatelHeader:
        week, of_week_ns = gps_week(self._now_ns + 500_000)  # to the nearest millisecond
        status = self._status if self._powered else self._status | encode_words((UNPOWERED,))[1]
        time = (FINE_STEERING, week & 0xFFFF, of_week_ns // 1_000_000)
        return NovatelHeader(b"", 0, number, 0, COM1, 0, sequence, IDLE_TIME, *time, status, 0, 0)

    def _is_due(self, number: int, bodies: list[bytes]) -> bool:
        request = self._requests.get(number)
        if self._unasked or request is None:
            return self._unasked
        if request.trigger in ONE_SHOT_TRIGGERS:
            del self._requests[number]
            return True
        if request.period_ns:
            turn, before = self._now_ns // request.period_ns, self._turns.get(number)
            self._turns[number] = turn
            return turn != before
        before_bodies, self._last_bodies[number] = self._last_bodies.get(number), bodies
        return request.trigger != TRIGGERS["onchanged"] or bodies != before_bodies

    def _without_antenna(self, measured: Position | Velocity) -> Any:
        """The solution, not valid without antenna supply."""
        return measured if self._powered else replace(measured, valid=False)

    def _device_status(self, status: DeviceStatus) -> Bodies:
        if not self._powered:
            status = replace(status, flags=(*status.flags, UNPOWERED))
        self._status = encode_words(status.flags)[1]
        return [(messages.RXSTATUS, [encode_rxstatus(status)])]

    def _reading(self, reading: Reading) -> Bodies:
        if reading.name == UTC_OFFSET:
            self._utc_offset = reading
        return []

    def _receiver_clock(self, clock: ReceiverClock) -> Bodies:
        self._clock = clock
        return [] if clock.drift is None else [(messages.CLOCKMODEL, [encode_clockmodel(clock, self._now_ns)])]

    def _satellites(self, sky: Satellites) -> Bodies:
        bodies: Bodies = [(messages.SATVIS2, encode_satvis2(sky))]
        if sky.hdop is not None or sky.used is not None:
            self._used = min(sky.used or 0, 255)
            bodies.insert(0, (messages.PSRDOP, [encode_psrdop(sky)]))
        return bodies

    # -------------------------------------------------------------------------------------------------- commands

    def respond(self, data: bytes) -> list[bytes]:
        return [answer for _, frame in self._framer.feed(data, 0) for answer in self._answer(frame)]

    def _answer(self, frame: bytes) -> list[bytes]:
        if frame.startswith(b"#"):
            return self._answer_ascii(frame)
        if not frame.startswith(SYNC):
            return self._answer_line(frame.decode("ascii", errors="replace").split())
        header, body = split(frame)
        code, text = self._execute(header.message_id, body)
        return [commands.encode_answer(self._header(0, 0), header.message_id, code, text)]

    def _answer_line(self, words: list[str]) -> list[bytes]:
        if not words:
            return []
        code, text = self._execute_words(words)
        line = "OK" if code == commands.CODE_OK else f"ERROR:{text}"
        return [b"\r\n<" + line.encode("ascii") + PROMPT]

    def _answer_ascii(self, line: bytes) -> list[bytes]:
        if measure(bytearray(line)) != len(line):
            return []
        head, _, rest = line[1:].decode("ascii").partition(";")
        name = head.partition(",")[0].removesuffix("A")
        _, text = self._execute_words([name, *rest.partition("*")[0].split(",")])
        return [encode_text(f"{name}R,COM1,0,50.0,FINESTEERING,{self._header(0, 0).week},0.000,0,0,0;{text}")]

    def _execute_words(self, words: list[str]) -> tuple[int, str]:
        try:
            header, body = split(parse_abbreviated(words))
        except ValueError:
            return INVALID_FIELD if words[0].lower() in commands.COMMANDS else INVALID_ID
        return self._execute(header.message_id, body)

    def _execute(self, number: int, body: bytes) -> tuple[int, str]:
        handler = self._answers.get(number)
        return handler(body) if handler else INVALID_ID

    def _log(self, body: bytes) -> tuple[int, str]:
        if len(body) < commands.LOG.size:
            return INVALID_FIELD
        _, number, _, _, trigger, period, _, _ = commands.LOG.unpack_from(body)
        if number not in messages.NAMES:
            return NO_SUCH_LOG
        try:
            seconds = commands.check_period(period) if trigger == TRIGGERS["ontime"] else 0.0
        except ValueError:
            return INVALID_RATE
        self._requests[number] = LogRequest(trigger, round(seconds * SECOND_NS))
        return OK

    def _unlog(self, body: bytes) -> tuple[int, str]:
        if len(body) < commands.UNLOG.size:
            return INVALID_FIELD
        self._requests.pop(commands.UNLOG.unpack_from(body)[1], None)
        return OK

    def _clear_requests(self, body: bytes) -> tuple[int, str]:
        self._requests.clear()
        return OK

    def _power(self, body: bytes) -> tuple[int, str]:
        self._powered = body[:1] != b"\0"
        return OK


def parse_abbreviated(words: list[str]) -> bytes:
    """The binary form of an abbreviated command: ``log com1 bestposb ontime 0.1``.  Raises ValueError."""
    name, *rest = (word.lower() for word in words)
    args: dict[str, str] = {}
    if name in ("log", "unlog"):
        if rest and rest[0] in commands.PORTS:
            args["port"] = rest.pop(0)
        if rest:
            message = rest.pop(0).upper()  # its last letter may be its format
            has_format = message not in messages.NUMBERS and message[:-1] in messages.NUMBERS
            args["message"] = message[:-1] if has_format else message
        if name == "log":
            args["trigger"] = rest.pop(0) if rest else "once"
            if rest and args["trigger"] == "ontime":
                args["period"] = rest[0]
    elif rest and name in commands.COMMANDS:
        args[next(iter(commands.COMMANDS[name].arguments))] = rest[0]
    return commands.command(name, args)
