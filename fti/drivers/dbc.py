"""Any messages on CAN, described by a DBC: a sensor that needs a file and no code.

Document: DBC file format (Vector Informatik, "DBC File Format Documentation" 1.0.5), as cantools reads it; the
DBC contains the layout of every message.

    BO_ identifier name: length sender         29-bit identifiers have bit 31 set; more than 8 bytes is CAN FD
     SG_ name [M|m3] : start|bits@order+sign (factor,offset) [min|max] "unit" receivers
    VAL_ identifier signal 0 "off" 1 "on" ;    names of raw values
    BA_ "GenMsgCycleTime" BO_ identifier 100;  period [ms]
    SIG_VALTYPE_ identifier signal : 1;        1 float, 2 double

Conversion of a signal:

    its name is a quantity (``fti.formats.quantities``) and its unit fits      the measurement, in SI
    any other                                                       Reading "MESSAGE.SIGNAL" in the unit of the DBC

Big- and little-endian, signed, float, multiplexed (also one in the other, ranges of selectors), extended identifiers,
CAN FD.  A value outside [min|max] is not valid.  A raw value with a name in a value table gives the ``text`` of the
Reading; for a physical signal (with a unit, a factor or an offset) it is a state, not a number: "not available" never
becomes 655.35.  A quantity whose unit does not fit becomes a Reading.  A value is a float: integers beyond 2^53 lose
their last digits.  Signals may overlap.  A frame shorter than its message is skipped; of a frame with an unknown
multiplexer value, the other signals are decoded.

Option ``counter`` names the signal that counts the messages (``_node_supervision``): lost messages and silent nodes are
reported as a DeviceStatus.  Nodes are the senders of the DBC, otherwise the messages.  Without a DBC the driver uses
that of CANaerospace as an example.
"""

from __future__ import annotations

import importlib.resources
from functools import cache
from typing import Annotated

from pydantic import Field

from fti.canframe import EXTENDED
from fti.config import StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.drivers import Counters
from fti.drivers._dbc_frames import FrameBuilder
from fti.drivers._no_commands import COMMANDS, command, on_connect, poll  # noqa: F401 - the rest of the contract
from fti.drivers._node_supervision import NodeSupervisor, node_status
from fti.formats.can_identifiers import frame_head, skip_reason
from fti.formats.dbc_makers import Maker, maker_of, quantity_scale
from fti.formats.dbc_messages import DbcMessage, DbcSignal, read_layouts
from fti.formats.quantities import QUANTITIES
from fti.messages.measurements import Measurement, Reading, Stamp

DOCUMENT = "DBC file format 1.0.5 (Vector Informatik); messages of the configured DBC"
MESSAGES = {"(other)": "every message of the DBC, by its name: quantities as measurements, other signals as readings"}
CARRIERS = frozenset({"can"})

BUILT_IN_DBC = importlib.resources.files("fti.drivers.canaerospace").joinpath("parameters.dbc")


class Options(StrictModel):
    """Options of devices on CAN whose messages a DBC describes."""

    dbc_file: Annotated[str | None, key("file of the DBC; none: the text in dbc", NO_UNIT, "dbc/air_data_unit.dbc")] = (
        None
    )
    dbc: Annotated[str, key("text of the DBC, filled in from dbc_file; empty: CANaerospace", NO_UNIT)] = ""
    counter: Annotated[
        str,
        key("signal that counts the messages of an identifier and rolls over at its maximum; empty: none", NO_UNIT),
    ] = "message_code"
    silent_after: Annotated[
        float, Field(ge=2, le=1000), key("message periods without a message until a node is reported as silent", ONE)
    ] = 5.0


def text_of(options: Options) -> str:
    """The text of the DBC."""
    return options.dbc or BUILT_IN_DBC.read_text("utf-8")


class MessagePlan:
    """Decoding plan of one message."""

    def __init__(self, layout: DbcMessage, counter: str) -> None:
        self.layout, self.name, self.length = layout, layout.name, layout.length
        self.node = layout.sender or layout.name
        self.counter = next((s for s in layout.signals if s.name == counter and not s.selector), None)
        self._makers = {s.name: maker_of(layout.name, s) for s in layout.signals}
        self._always = tuple(self._makers.values())
        self._cases: dict[int, tuple[Maker, ...]] = {}  # by identity: the layout has one tuple for each case

    def makers(self, little: int, big: int) -> tuple[Maker, ...]:
        """The makers of the signals that are in this frame."""
        if not self.layout.selectors:
            return self._always
        signals = self.layout.signals_in(little, big)
        makers = self._cases.get(id(signals))
        if makers is None:
            makers = self._cases[id(signals)] = tuple(self._makers[s.name] for s in signals)
        return makers


@cache
def read_plans(text: str, counter: str) -> dict[int, MessagePlan]:
    """The messages of a DBC by the first word of their frames.  Raises ValueError with the error."""
    plans = {layout.can_id | EXTENDED * layout.extended: MessagePlan(layout, counter) for layout in read_layouts(text)}
    if not plans:
        raise ValueError("dbc: contains no message")
    return plans


class Decoder:
    """CAN frames, one per feed, to measurements.  Raises ValueError for a wrong DBC."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._plans = read_plans(text_of(options), options.counter)
        counter = options.counter if "counter" in options.model_fields_set else ""
        if counter and not any(plan.counter for plan in self._plans.values()):
            raise ValueError(f"counter = {counter!r}: no message of the DBC has such a signal")
        self._watch = NodeSupervisor(options.silent_after, self.counters.lost)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        counters = self.counters
        counters.bytes_in += len(data)
        word, length = frame_head(data)
        plan = self._plans.get(word)
        if plan is None or length < plan.length:
            counters.skipped["bad_data" if plan else skip_reason(data)] += len(data)
            conditions = self._watch.tick(t_rx_ns)
            return [node_status(Stamp(t_rx_ns), conditions)] if conditions else []
        counters.framed += len(data)
        counters.messages[plan.name] += 1
        return self._decode(plan, data[8 : 8 + plan.length], Stamp(t_rx_ns))

    def _decode(self, plan: MessagePlan, data: bytes, stamp: Stamp) -> list[Measurement]:
        little, big = int.from_bytes(data, "little"), int.from_bytes(data, "big")
        measurements = [m for make in plan.makers(little, big) if (m := make(stamp, little, big)) is not None]
        code = int(plan.counter.extract(little, big)) if plan.counter else None
        modulus = plan.counter.modulus if plan.counter else 0
        conditions = self._watch.handle_message(
            stamp.t_rx_ns, plan.node, plan.name, code=code, modulus=modulus, cycle_ns=plan.layout.cycle_ns
        )
        if conditions:
            measurements.append(node_status(stamp, conditions))
        return measurements


class Encoder:
    """The emulated units: a message is sent when every signal of it has a new value."""

    def __init__(self, options: Options) -> None:
        self._counter = options.counter
        self._builders = {
            plan.layout.name: FrameBuilder(plan.layout) for plan in read_plans(text_of(options), "").values()
        }
        self._codes: dict[str, int] = {}

    def encode(self, measurement: Measurement) -> list[bytes]:
        if isinstance(measurement, Reading):
            builders = self._set_reading(measurement)
        else:
            builders = [b for b in self._builders.values() if self._set_quantities(b, measurement)]
        frames = [self._frame(builder) for builder in builders]
        return [frame for frame in frames if frame is not None]

    def respond(self, data: bytes) -> list[bytes]:
        return []

    def _set_reading(self, reading: Reading) -> list[FrameBuilder]:
        message, _, name = reading.name.partition(".")
        builder = self._builders.get(message)
        if builder is None or name not in builder.signals:
            return []
        raw = raw_of(builder.signals[name], reading)
        if raw is not None:
            builder.set_raw(name, raw)
        return [builder]

    def _set_quantities(self, builder: FrameBuilder, measurement: Measurement) -> bool:
        if not getattr(measurement, "valid", True):
            return False
        is_updated = False
        for signal in builder.layout.signals:
            scale = quantity_scale(signal)
            if scale is None:
                continue
            value = QUANTITIES[signal.name].pick(measurement)
            if value is not None:
                builder.set_raw(signal.name, signal.raw((value - scale[1]) / scale[0]))
                is_updated = True
        return is_updated

    def _frame(self, builder: FrameBuilder) -> bytes | None:
        name = builder.layout.name
        code = self._codes.get(name, 0)
        frame = builder.build({self._counter: code})
        if frame is not None and self._counter in builder.signals:
            self._codes[name] = (code + 1) % builder.signals[self._counter].modulus
        return frame


def raw_of(signal: DbcSignal, reading: Reading) -> float | None:
    """The raw value of a reading, from its text or its number; None without both."""
    if reading.text in signal.states.values():
        return next(raw for raw, name in signal.states.items() if name == reading.text)
    return None if reading.value is None else signal.raw(reading.value)


make_decoder, make_encoder = Decoder, Encoder
