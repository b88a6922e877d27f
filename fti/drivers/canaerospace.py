"""Air data, surface positions, radio height and DME on CAN, through a DBC; CANaerospace 1.7 by default.

Document: CANaerospace interface specification 1.7 (Stock Flight Systems, 2006), sections 3 and 5.1, 5.7.

    11-bit identifier | byte 0 node | 1 data type | 2 service | 3 message code | 4-7 data, big-endian

    data type 2 = FLOAT; the message code counts the messages of an identifier and rolls over at 255
    306-310 rudder, stabilizer, elevator, left and right aileron [deg]   311 pitch, 312 roll, 313 sideslip [deg]
    315 IAS, 316 TAS, 317 CAS [m/s]   320 baro-corrected, 322 standard altitude [m]   323 TAT, 324 SAT [K]
    325 differential, 326 static pressure [hPa]   328 angle of attack [deg]   1070 radio height, 1071-1074 DME [m]

The identifiers and layouts of the makers' units are not public, so the DBC is the interface (option ``dbc_file``): a
signal becomes a measurement by its name (a quantity of ``_quantities``) and its unit in the DBC; every other signal
is ignored, except that ``message_code`` counts and ``data_type`` selects when the emulator sends.  The built-in DBC
is ``canaerospace.dbc``.

Open: the notes on 313 say "yaw right +", the text says that the signs are those of ISO 1151; ISO is taken (wind from
the right is positive); a negative factor in the DBC turns it.  The protocol has no agreed flag for validity: what
the emulator's sensor knows to be wrong is not sent.
"""

from __future__ import annotations

import importlib.resources
import math
from functools import cache
from typing import Annotated, Any, NamedTuple

import cantools.database
from cantools.database.can.database import Database
from cantools.database.errors import DecodeError, Error
from pydantic import Field

from fti.canframe import pack_can, unpack_can
from fti.config import StrictModel
from fti.drivers import Counters
from fti.drivers._quantities import QUANTITIES, Quantity, to_si
from fti.drivers._talker import COMMANDS, command, on_connect, poll  # noqa: F401 - the rest of the contract
from fti.types import Measurement, Stamp

DOCUMENT = "CANaerospace interface specification 1.7 (Stock Flight Systems, 2006); other layouts by DBC"
MESSAGES = dict.fromkeys(QUANTITIES, "a signal of this name in the DBC")
CARRIERS = frozenset({"can"})


class Options(StrictModel):
    """``dbc_file`` names a DBC (``dbc`` is its text, filled in from the file); empty is the built-in one.

    ``node``: only frames of this node number (byte 0); the emulator sends under it, or else under 1.
    """

    dbc_file: str | None = None
    dbc: str = ""
    node: Annotated[int, Field(ge=0, le=255)] | None = None


class Signal(NamedTuple):
    """A signal that is understood: its name, quantity, and factor and offset to SI."""

    name: str
    quantity: Quantity
    factor: float
    offset: float


class Known(NamedTuple):
    """A message of the DBC with at least one signal that is understood."""

    message: Any  # cantools' Message; the package has no types that mypy can follow
    signals: tuple[Signal, ...]


@cache
def read_dbc(text: str) -> dict[tuple[int, bool], Known]:
    """The messages that are understood, by (identifier, extended).  Raises ValueError naming what is wrong."""
    try:
        database = cantools.database.load_string(text or _built_in(), "dbc", strict=True)
    except Error as error:
        reason = str(error).removeprefix('DBC: "').removesuffix('"')
        raise ValueError(f"dbc: {reason}") from None
    assert isinstance(database, Database)
    found = {(m.frame_id, m.is_extended_frame): Known(m, _signals(m)) for m in database.messages}
    known = {key: value for key, value in found.items() if value.signals}
    if not known:
        raise ValueError(f"dbc: no signal has a name that is understood; those are {', '.join(QUANTITIES)}")
    return known


def _built_in() -> str:
    return importlib.resources.files("fti.drivers").joinpath("canaerospace.dbc").read_text(encoding="utf-8")


def _signals(message: Any) -> tuple[Signal, ...]:
    return tuple(_signal(message.name, s) for s in message.signals if s.name in QUANTITIES)


def _signal(message: str, signal: Any) -> Signal:
    try:
        factor, offset = to_si(signal.name, signal.unit or "")
    except ValueError as error:
        raise ValueError(f"dbc: message {message!r}: {error}") from None
    return Signal(signal.name, QUANTITIES[signal.name], factor, offset)


def decode_data(known: Known, data: bytes, stamp: Stamp) -> list[tuple[str, Measurement]]:
    """The measurements in a frame's data, by signal name.  Raises cantools' DecodeError when the data do not fit."""
    values = known.message.decode(data, decode_choices=False)
    found = []
    for name, quantity, factor, offset in known.signals:
        value = values.get(name)
        if value is None or not math.isfinite(value):
            continue
        measurement = quantity.make(stamp, value * factor + offset, True)
        if measurement is not None:
            found.append((name, measurement))
    return found


class Decoder:
    """CAN frames, one per feed, to measurements."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._node = options.node
        self._known = read_dbc(options.dbc)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        self.counters.bytes_in += len(data)
        reason, found = self._decode(data, Stamp(t_rx_ns))
        if reason:
            self.counters.skipped[reason] += len(data)
            return []
        self.counters.framed += len(data)
        self.counters.messages.update(name for name, _ in found)
        return [measurement for _, measurement in found]

    def _decode(self, data: bytes, stamp: Stamp) -> tuple[str, list[tuple[str, Measurement]]]:
        """Why the frame is skipped ("" when it is not), and what is in it."""
        try:
            frame = unpack_can(data)
        except ValueError:
            return "no_frame", []
        if frame.error or frame.remote:
            return "error_frame" if frame.error else "remote_frame", []
        known = self._known.get((frame.can_id, frame.extended))
        if known is None:
            return "other_id", []
        if self._node is not None and frame.data[:1] != bytes([self._node]):
            return "other_node", []
        try:
            return "", decode_data(known, frame.data, stamp)
        except DecodeError:
            return "bad_data", []


class Encoder:
    """The units' end of the bus: a message goes out when every signal of it that is understood has been told anew."""

    def __init__(self, options: Options) -> None:
        self._node = 1 if options.node is None else options.node
        self._known = list(read_dbc(options.dbc).values())
        self._values: dict[str, dict[str, float]] = {}
        self._codes: dict[str, int] = {}

    def encode(self, measurement: Measurement) -> list[bytes]:
        if not getattr(measurement, "valid", True):
            return []
        frames = [self._frame(known) for known in self._known if self._take(known, measurement)]
        return [frame for frame in frames if frame is not None]

    def respond(self, data: bytes) -> list[bytes]:
        return []

    def _take(self, known: Known, measurement: Measurement) -> bool:
        """Keep what the measurement says for this message; true when it says anything."""
        said = {s.name: s.quantity.pick(measurement) for s in known.signals}
        new = {s.name: (v - s.offset) / s.factor for s in known.signals if (v := said[s.name]) is not None}
        self._values.setdefault(known.message.name, {}).update(new)
        return bool(new)

    def _frame(self, known: Known) -> bytes | None:
        message, values = known.message, self._values[known.message.name]
        if len(values) < len(known.signals):
            return None
        self._values[message.name] = {}
        code = self._codes.get(message.name, 0)
        self._codes[message.name] = (code + 1) & 0xFF
        header = {"node_id": self._node, "message_code": code}
        content = {s.name: _fitting(s, header.get(s.name, s.initial or 0)) for s in message.signals}
        content |= {s.name: _fitting(s, values[s.name]) for s in message.signals if s.name in values}
        content |= {s.name: _selection(message, s.name) for s in message.signals if s.is_multiplexer}
        data = message.encode(content, strict=False)
        return pack_can(message.frame_id, data, extended=message.is_extended_frame, fd=message.length > 8)


def _fitting(signal: Any, value: float) -> float:
    """The value within the limits that the DBC states."""
    low = -math.inf if signal.minimum is None else signal.minimum
    high = math.inf if signal.maximum is None else signal.maximum
    return float(min(max(value, low), high))


def _selection(message: Any, selector: str) -> int:
    """What a multiplexer must say so that the signals that are understood are sent."""
    chosen = (s for s in message.signals if s.name in QUANTITIES and s.multiplexer_signal == selector)
    return next((int(s.multiplexer_ids[0]) for s in chosen), 0)


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder.  Raises ValueError when the DBC is wrong."""
    return Decoder(options)


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder.  Raises ValueError when the DBC is wrong."""
    return Encoder(options)
