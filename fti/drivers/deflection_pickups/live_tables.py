"""Present tables of the nodes: from the calibration file, then changed only by acknowledgements of nodes.

Decoding a recording again therefore gives the same deflections: it contains the acknowledgements.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fti.drivers.deflection_pickups import service as wire
from fti.drivers.deflection_pickups.layout import SENSORS, Pickup, PickupBus
from fti.drivers.deflection_pickups.table import CalibrationTable
from fti.messages.measurements import Ack, Calibration, DeviceStatus, Measurement, Stamp

NamedMeasurements = tuple[str, list[Measurement]]


@dataclass(slots=True)
class _TableTransfer:
    count: int
    points: list[tuple[int, int]] = field(default_factory=list)


class LiveTables:
    """The tables of one bus."""

    def __init__(self, bus: PickupBus, tables: Mapping[str, CalibrationTable]) -> None:
        self._bus = bus
        self._tables = dict(tables)
        self._transfers: dict[str, _TableTransfer] = {}
        self._nodes = {s.node_id: s.node for s in bus.sensors.values()}

    def copy_tables(self, previous: LiveTables) -> None:
        """Copy the tables of another decoder, without incomplete transfers."""
        self._tables = dict(previous._tables)

    def deflection(self, surface: str, raw: int) -> float | None:
        """Deflection [rad] from the table; None outside it or without a table."""
        table = self._tables.get(surface)
        return None if table is None else table.deflection(raw)

    def handle_response(self, data: bytes, stamp: Stamp) -> NamedMeasurements:
        """Decode a response of a node: name of the message and measurements; "" for an unknown node.

        Raises ValueError for data that are not a response.
        """
        service = wire.unpack_service(data)
        if service.node not in self._nodes:
            return "", []
        if service.number == wire.TIS:
            return "set_rate", [self._interval(service, stamp)]
        if service.number in (wire.INSERT, wire.MODIFY, wire.DELETE, wire.READ):
            return wire.NAMES[service.number], self._answer(service, stamp)
        if wire.POINT <= service.number < wire.POINT + SENSORS:
            return "point", self._point(service, stamp)
        return f"service_{service.number}", []

    def _interval(self, service: wire.Service, stamp: Stamp) -> Ack:
        echo = wire.unpack_interval(service)
        detail = f"node {self._nodes[service.node]}"
        if echo and echo[1]:
            detail += f": message {echo[0]} at {1000.0 / echo[1]:g} Hz"
        accepted = service.code == 0
        reason = "out of range" if service.code == wire.OUT_OF_RANGE else f"result {service.code}"
        text = detail if accepted else f"{detail}: refused: {reason}"
        return Ack(stamp=stamp, command="set_rate", accepted=accepted, detail=text)

    def _answer(self, service: wire.Service, stamp: Stamp) -> list[Measurement]:
        """The response to an edit or to a request for the table."""
        command = wire.NAMES[service.number]
        sensor = self._bus.find_sensor(service.node, service.sensor)
        if sensor is None or not service.is_done:
            surface = sensor.surface if sensor else f"node {self._nodes[service.node]}, sensor {service.sensor}"
            return [Ack(stamp=stamp, command=command, accepted=False, detail=f"{surface}: {service.result}")]
        if service.number == wire.READ:
            count = wire.unpack_count(service)
            self._transfers.pop(sensor.surface, None)
            if not count:
                return [self._read_ack(sensor.surface, False, "the node has no table", stamp)]
            self._transfers[sensor.surface] = _TableTransfer(count)
            return []
        raw, hundredths = wire.unpack_point(service)
        description = f"raw {raw}" if service.number == wire.DELETE else f"raw {raw} = {hundredths / 100:.2f} deg"
        ack = Ack(stamp=stamp, command=command, accepted=True, detail=f"{sensor.surface}: {description}")
        self._transfers.pop(sensor.surface, None)  # the edit makes an active transfer invalid
        return [ack, *self._apply_node_edit(sensor, service, (raw, hundredths), f"{command} {description}", stamp)]

    def _apply_node_edit(
        self, sensor: Pickup, service: wire.Service, point: tuple[int, int], change: str, stamp: Stamp
    ) -> list[Measurement]:
        """Apply an edit of the node to our table; if that fails, the tables differ and ours is deleted."""
        table = self._tables.get(sensor.surface)
        if table is None:
            return []
        try:
            changed = _apply_edit(table, service.number, point)
        except ValueError:
            del self._tables[sensor.surface]
            return [DeviceStatus(stamp=stamp, ok=False, flags=(f"{sensor.surface}_table_differs",))]
        return self._set(sensor.surface, changed, change, stamp)

    def _point(self, service: wire.Service, stamp: Stamp) -> list[Measurement]:
        """One point of a table transfer; the last one completes it."""
        sensor = self._bus.find_sensor(service.node, service.number - wire.POINT)
        transfer = self._transfers.get(sensor.surface) if sensor else None
        if sensor is None or transfer is None:
            return []
        point = wire.unpack_point(service)
        if service.code != len(transfer.points):
            del self._transfers[sensor.surface]
            return [self._read_ack(sensor.surface, False, "a point is missing", stamp)]
        transfer.points.append(point)
        return [] if len(transfer.points) < transfer.count else self._finish_transfer(sensor.surface, stamp)

    def _finish_transfer(self, surface: str, stamp: Stamp) -> list[Measurement]:
        points = self._transfers.pop(surface).points
        try:
            table = CalibrationTable(tuple(points))
        except ValueError as error:
            return [self._read_ack(surface, False, str(error), stamp)]
        ack = self._read_ack(surface, True, f"{len(points)} points", stamp)
        return [ack, *self._set(surface, table, "read_table", stamp)]

    def _read_ack(self, surface: str, accepted: bool, detail: str, stamp: Stamp) -> Ack:
        return Ack(stamp=stamp, command="read_table", accepted=accepted, detail=f"{surface}: {detail}")

    def _set(self, surface: str, table: CalibrationTable, change: str, stamp: Stamp) -> list[Measurement]:
        """Set a table; a changed table gives a Calibration."""
        if self._tables.get(surface) == table:
            return []
        self._tables[surface] = table
        return [Calibration(stamp=stamp, surface=surface, points=table.as_points(), change=change)]


def _apply_edit(table: CalibrationTable, number: int, point: tuple[int, int]) -> CalibrationTable:
    """The table after an edit that a node has acknowledged.  Raises ValueError if the tables differ.

    A node modifies only an existing point, and inserts only a new one; a repeated answer is accepted.
    """
    if number == wire.DELETE:
        return table.without_point(point[0])
    if number == wire.MODIFY and not table.has_point(point[0]):
        raise ValueError(f"no point with raw count {point[0]}")
    if number == wire.INSERT and table.has_point(point[0]) and point not in table.points:
        raise ValueError(f"another point with raw count {point[0]}")
    return table.with_point(*point)
