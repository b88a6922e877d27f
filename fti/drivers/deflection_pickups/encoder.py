"""The emulated micro-controllers: they calibrate, store their tables and answer node services.

A node samples with each raw count that it gets; a lower rate setting reduces its messages, a higher one has no effect.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fti.drivers._dbc_frames import FrameBuilder
from fti.drivers.canaerospace.data_types import UCHAR4
from fti.drivers.canaerospace.encoder import IDENTIFICATION
from fti.drivers.deflection_pickups import service as wire
from fti.drivers.deflection_pickups.layout import COUNTER, DEFLECTION, NODE_ID, RAW, Pickup, PickupBus, PickupMessage
from fti.drivers.deflection_pickups.service import Service
from fti.drivers.deflection_pickups.table import MAX_POINTS, MIN_POINTS, CalibrationTable
from fti.formats.can_identifiers import frame_head
from fti.messages.measurements import Measurement, SurfaceDeflection

MILLISECOND_NS = 1_000_000
MIN_RATE_HZ, MAX_RATE_HZ = 1, 100
INTERVALS_MS = range(1000 // MAX_RATE_HZ, 1000 // MIN_RATE_HZ + 1)


class Encoder:
    """The nodes of one bus.  tables : stored tables at the start."""

    def __init__(self, bus: PickupBus, tables: Mapping[str, CalibrationTable]) -> None:
        self._bus = bus
        self._tables = dict(tables)
        self._builders = {m.layout.name: (m, FrameBuilder(m.layout)) for m in bus.messages.values()}
        messages = [(name, m) for name, (m, _) in self._builders.items()]
        self._fixed = {name: {NODE_ID: m.node_id} | _fixed_signals(m) for name, m in messages}
        self._raw = {s: [(name, m.raw[s]) for name, m in messages if s in m.raw] for s in bus.sensors}
        self._deflections = {
            s: [(name, *m.deflection[s]) for name, m in messages if s in m.deflection] for s in bus.sensors
        }
        self._codes: dict[str, int] = {}
        self._intervals_ns: dict[str, int] = {}
        self._due_ns: dict[str, int] = {}

    def encode(self, measurement: Measurement) -> list[bytes]:
        """Raw count and deflection; a missing deflection comes from the table of the node, if the count is inside."""
        if not isinstance(measurement, SurfaceDeflection) or not measurement.valid:
            return []
        sensor = self._bus.sensors.get(measurement.surface)
        if sensor is None or not self._is_due(sensor.surface, measurement.stamp.t_rx_ns):
            return []
        deflection, table = measurement.deflection, self._tables.get(sensor.surface)
        if deflection is None and measurement.raw is not None and table is not None:
            deflection = table.deflection(measurement.raw)
        updated = self._set_raw(sensor.surface, measurement.raw) + self._set_deflection(sensor.surface, deflection)
        frames = [self._frame(*self._builders[name]) for name in dict.fromkeys(updated)]
        return [frame for frame in frames if frame is not None]

    def _is_due(self, surface: str, t_ns: int) -> bool:
        interval = self._intervals_ns.get(surface)
        if interval is None:
            return True
        due = self._due_ns.get(surface, t_ns)
        if t_ns < due - interval // 4:
            return False
        self._due_ns[surface] = max(due, t_ns) + interval
        return True

    def _set_raw(self, surface: str, raw: int | None) -> list[str]:
        if raw is None:
            return []
        for name, signal in self._raw[surface]:
            self._builders[name][1].set_raw(signal.name, signal.raw(raw))
        return [name for name, _ in self._raw[surface]]

    def _set_deflection(self, surface: str, deflection: float | None) -> list[str]:
        if deflection is None:
            return []
        for name, signal, factor in self._deflections[surface]:
            self._builders[name][1].set_raw(signal.name, signal.raw(deflection / factor))
        return [name for name, _, _ in self._deflections[surface]]

    def _frame(self, message: PickupMessage, builder: FrameBuilder) -> bytes | None:
        name = message.layout.name
        code = self._codes.get(name, 0)
        frame = builder.build({COUNTER: code} | self._fixed[name])
        if frame is not None and message.counter is not None:
            self._codes[name] = (code + 1) % message.counter.modulus
        return frame

    def respond(self, data: bytes) -> list[bytes]:
        """Answers to a request, of every addressed node and sensor."""
        word, length = frame_head(data)
        if word != self._bus.request or self._bus.response is None:
            return []
        try:
            request = wire.unpack_service(data[8 : 8 + length])
        except ValueError:
            return []
        return [wire.pack_service(self._bus.response, answer) for answer in self._answers(request)]

    def _answers(self, request: Service) -> list[Service]:
        nodes = sorted({s.node_id for s in self._bus.sensors.values()})
        answers: list[Service] = []
        for node in nodes:
            if request.node in (wire.ALL_NODES, node):
                answers += self._answers_of(node, request)
        return answers

    def _answers_of(self, node: int, request: Service) -> list[Service]:
        if request.number == wire.TIS:
            return self._set_interval(node, request)
        if request.number == wire.IDS:
            return [Service(node, wire.IDS, request.code, UCHAR4, IDENTIFICATION)]
        handle = self._HANDLERS.get(request.number)
        if handle is None:
            return []
        if request.code == wire.ALL_SENSORS and request.number == wire.READ:
            sensors = [s for s in self._bus.sensors.values() if s.node_id == node]
            return [answer for sensor in sensors for answer in handle(self, sensor, request)]
        sensor = self._bus.find_sensor(node, request.code)
        if sensor is None:
            return [Service(node, request.number, request.code & 0x0F | wire.NO_SENSOR << 4)]
        return handle(self, sensor, request)

    def _set_interval(self, node: int, request: Service) -> list[Service]:
        interval = wire.unpack_interval(request)
        surfaces = {
            surface
            for m, _ in self._builders.values()
            if interval and m.node_id == node and m.layout.can_id & 0xFFFF == interval[0]
            for surface in (*m.raw, *m.deflection)
        }
        if interval is None or not surfaces or interval[1] not in INTERVALS_MS:
            return [Service(node, wire.TIS, wire.OUT_OF_RANGE)]
        for surface in surfaces:
            self._intervals_ns[surface] = interval[1] * MILLISECOND_NS
        return [Service(node, wire.TIS, 0, request.kind, request.data)]

    def _edit(self, sensor: Pickup, request: Service) -> list[Service]:
        """Insert, modify or delete a point; the answer echoes the stored point."""
        try:
            point = wire.unpack_point(request)
        except ValueError:
            return []
        result, table = edit_table(self._tables.get(sensor.surface), request.number, point)
        if table is not None:
            self._tables[sensor.surface] = table
        code = sensor.number | result << 4
        return [Service(sensor.node_id, request.number, code, wire.POINT_TYPE, wire.pack_point(*point))]

    def _read(self, sensor: Pickup, request: Service) -> list[Service]:
        table = self._tables.get(sensor.surface)
        points = table.points if table else ()
        count = Service(sensor.node_id, wire.READ, sensor.number, UCHAR4, wire.pack_count(len(points)))
        return [count] + [
            Service(sensor.node_id, wire.POINT + sensor.number, i, wire.POINT_TYPE, wire.pack_point(*point))
            for i, point in enumerate(points)
        ]

    _HANDLERS: Mapping[int, Callable[[Encoder, Pickup, Service], list[Service]]] = {
        wire.INSERT: _edit,
        wire.MODIFY: _edit,
        wire.DELETE: _edit,
        wire.READ: _read,
    }


def edit_table(
    table: CalibrationTable | None, service: int, point: tuple[int, int]
) -> tuple[int, CalibrationTable | None]:
    """Edit a table like a node: result, and the changed table or None."""
    if table is None:
        return wire.NO_POINT, None
    refused = _refusal(table, service, point[0])
    if refused:
        return refused, None
    try:
        return wire.DONE, table.without_point(point[0]) if service == wire.DELETE else table.with_point(*point)
    except ValueError:
        return wire.NOT_MONOTONE, None


def _refusal(table: CalibrationTable, service: int, raw: int) -> int:
    """Reason why a point with this raw count is refused; 0 if it is accepted."""
    if service == wire.INSERT:
        full = wire.TOO_MANY if len(table.points) >= MAX_POINTS else 0
        return wire.POINT_EXISTS if table.has_point(raw) else full
    if not table.has_point(raw):
        return wire.NO_POINT
    return wire.TOO_FEW if service == wire.DELETE and len(table.points) <= MIN_POINTS else 0


def _fixed_signals(message: PickupMessage) -> dict[str, float]:
    """Values of the other signals of a frame: a multiplexer selects the surface, the rest are 0."""
    ours = {s.name for s in message.layout.signals if s.name.endswith((RAW, DEFLECTION))}
    values: dict[str, float] = {
        s.name: 0 for s in message.layout.signals if s.name not in ours and s.name not in (NODE_ID, COUNTER)
    }
    for signal in message.layout.signals:
        if signal.name in ours and signal.selector:
            values[signal.selector] = min(signal.choices)
    return values
