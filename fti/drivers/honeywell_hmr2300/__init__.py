r"""Honeywell HMR2300 smart digital magnetometer, RS-232 or RS-485 (half duplex), 9600 or 19200 Bd 8N1.

Document: Honeywell, Smart Digital Magnetometer HMR2300, data sheet 900139 (command inputs, data formats, parameter
selection).  15000 counts are 1 gauss, +-30000 counts are the range, one count is 6.67 nT.

    binary   X hi | X lo | Y hi | Y lo | Z hi | Z lo | 0D                               7 bytes, int16 big-endian
    ASCII    three times: sign, two digits, comma, three digits, two spaces; then 0D    28 bytes, "- 7,500  " = -0.5 G
    answers  text and 0D: "OK", "BINARY ON", "WE OFF", "Re-enter", "ID= 07" (see ``commands``)

The data sheet prints -1.0 G as C3 74; it is C5 68 (docs/errata.md).

A sample has no checksum, and 0D may occur inside it: ``framing`` documents the search of boundaries and its error
rates.  A sample outside +-30000 counts is not valid; neither are the three after a set or reset pulse.

``mode`` "polled" requests a sample every ``poll_s`` (for RS-485: set ``half_duplex`` of the link); "continuous" starts
the device at ``rate`` when the port is opened.  Above 30 (ASCII) or 100 (binary) samples a second the line needs
19200 Bd, and the device ignores commands that follow each other within 20 ms.

The decoded field is in the axes of the sensor case; ``rpy_bs_deg`` of the device defines its mounting, and
``fti.nav.sensor_mounting`` rotates the field accordingly.  The emulated device starts with the options and follows all
rules of the commands; it samples at the rate of its model, independent of ``rate``.
"""

from __future__ import annotations

import re

from fti.drivers import Counters
from fti.drivers._framing import Framer
from fti.drivers.honeywell_hmr2300.commands import COMMANDS, Options, command, on_connect, poll
from fti.drivers.honeywell_hmr2300.encoder import Encoder
from fti.drivers.honeywell_hmr2300.framing import FULL_SCALE, LIMIT, SAMPLE, TEXT, Boundaries, counts_at
from fti.messages.measurements import Ack, MagneticField, Measurement, Reading, Stamp

__all__ = [
    "CARRIERS", "COMMANDS", "DOCUMENT", "MESSAGES", "Options", "command", "make_decoder", "make_encoder", "on_connect",
    "poll",
]  # fmt: skip

DOCUMENT = "Honeywell, Smart Digital Magnetometer HMR2300, data sheet 900139"
MESSAGES = {
    "binary": "magnetic field, three axes",
    "ascii": "magnetic field, three axes, as text",
    "answer": "answer of the device to a command",
}
CARRIERS = frozenset({"serial", "udp"})

TESLA_PER_COUNT = 1e-4 / 15_000
#: Samples after a set or reset pulse that are not valid.
UNSETTLED_SAMPLES = 3
#: Samples after which an answer no longer belongs to the write enable before it.
MAX_ANSWER_SAMPLES = 2
REFUSALS = {"WE OFF": "the write enable was off", "Re-enter": "unknown or not allowed"}
#: Prefix of an answer -> its command.
ANSWER_PREFIXES = (
    ("ASCII, ", "query"),
    ("BINARY, ", "query"),
    ("ASCII", "format"),
    ("BINARY", "format"),
    ("S/R", "set_reset_mode"),
    ("SET", "set_reset_pulse"),
    ("RST", "set_reset_pulse"),
    ("ZERO", "zero"),
    ("AVG", "average"),
    ("ID=", "identify"),
    ("SER#", "serial_number"),
    ("S/W", "software_version"),
    ("H/W", "hardware_version"),
)


def decode_ascii(frame: bytes) -> tuple[int, int, int]:
    """Counts of an ASCII sample."""
    x, y, z = (int(re.sub(rb"[ ,]", b"", frame[at : at + 9])) for at in (0, 9, 18))
    return x, y, z


def decode_counts(counts: tuple[int, int, int], stamp: Stamp, *, settled: bool) -> MagneticField:
    """The field [T] of three counts."""
    x, y, z = counts
    field_b = (x * TESLA_PER_COUNT, y * TESLA_PER_COUNT, z * TESLA_PER_COUNT)
    return MagneticField(stamp=stamp, field_b=field_b, valid=settled and max(map(abs, counts)) <= FULL_SCALE)


class Decoder:
    """Samples to MagneticField, answers to Ack."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._framer = Framer(Boundaries().measure, self.counters, limit=LIMIT)
        self._with_enable = options.enable == "together"
        self._unsettled = 0
        self._enabled_for = 0  # samples until the last answered write enable expires

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        measurements: list[Measurement] = []
        for t_ns, frame in self._framer.feed(data, t_rx_ns):
            text = TEXT.fullmatch(frame)
            if text is None and len(frame) == SAMPLE:
                measurements.append(self._sample("binary", counts_at(frame, 0), Stamp(t_ns)))
            elif text and text["sample"]:
                measurements.append(self._sample("ascii", decode_ascii(frame), Stamp(t_ns)))
            else:
                self.counters.messages["answer"] += 1
                measurements += self._answer(frame[:-1].decode("ascii"), Stamp(t_ns))
        return measurements

    def _sample(self, name: str, counts: tuple[int, int, int], stamp: Stamp) -> MagneticField:
        self.counters.messages[name] += 1
        self._enabled_for = max(0, self._enabled_for - 1)
        settled, self._unsettled = self._unsettled == 0, max(0, self._unsettled - 1)
        return decode_counts(counts, stamp, settled=settled)

    def _answer(self, text: str, stamp: Stamp) -> list[Measurement]:
        if text == "OK":
            return self._ok(stamp)
        if text.startswith("BAUD"):
            return [Reading(stamp=stamp, name="baud", value=float(re.sub(r"\D", "", text)))]
        if text == "DONE":
            return []
        self._enabled_for = 0
        if text in REFUSALS:
            return [Ack(stamp=stamp, command="", accepted=False, detail=f"{text}: {REFUSALS[text]}")]
        if text in ("SET", "RST"):
            self._unsettled = UNSETTLED_SAMPLES
        name = next(name for beginning, name in ANSWER_PREFIXES if text.startswith(beginning))
        return [Ack(stamp=stamp, command=name, accepted=True, detail=text)]

    def _ok(self, stamp: Stamp) -> list[Measurement]:
        """The first OK answers the write enable, the next one the command after it."""
        if self._enabled_for:
            self._enabled_for = 0
            return [Ack(stamp=stamp, command="", accepted=True)]
        self._enabled_for = MAX_ANSWER_SAMPLES
        return [] if self._with_enable else [Ack(stamp=stamp, command="write_enable", accepted=True)]


make_decoder, make_encoder = Decoder, Encoder
