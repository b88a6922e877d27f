"""Surface-deflection pickups: micro-controllers on CAN with up to four analog sensors each and calibration tables.

Document: Spiegel 2018, 6.1, tables 6.1 and 6.2, figures 6.14 and 6.15 (sensors, buses, rate,
calibration); node services as in the CANaerospace interface specification 1.7, section 4.

    tail            bus 2    elevator, rudder, rudder trim
    left wing       bus 1    left aileron
    right wing      bus 2    right aileron
    flaps           bus 1    flaps
    pilot controls  bus 1    stick aileron, stick elevator, pedals, elevator trim

    raw frame         CANaerospace header | raw count u16               identifiers 1600-1609
    deflection frame  CANaerospace header | deflection [deg] float      306, 308-310 as in CANaerospace; 1500-1505
    node service      request 128, response 129: see ``service``

Unknown: the maker's identifiers, layout and commands.  A DBC therefore defines the interface (option ``dbc_file``, see
``layout``); the above is that of the built-in one, with a copy in configs/dbc/deflection_pickups.dbc.

Raw count and deflection of one sample (equal message codes) form one measurement.  For a node that sends raw counts
only (its DBC has no deflection), the decoder applies the calibration table (option ``calibration_file``, see
``table``): piecewise linear; outside the table, and without one, the deflection is not valid and never extrapolated.

The nodes store the tables.  They are read after every connect and once a minute, and edited by commands.  The table of
the decoder changes only with acknowledgements of a node (``live_tables``); each change gives a ``Calibration``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated

from pydantic import Field

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.drivers import Command
from fti.drivers._arguments import check_complete, number_or_nan
from fti.drivers.deflection_pickups import service as wire
from fti.drivers.deflection_pickups import table
from fti.drivers.deflection_pickups.decoder import Decoder
from fti.drivers.deflection_pickups.encoder import MAX_RATE_HZ, MIN_RATE_HZ, Encoder
from fti.drivers.deflection_pickups.layout import Pickup, PickupBus, read_bus
from fti.drivers.deflection_pickups.service import Service
from fti.drivers.deflection_pickups.table import factory_tables

DOCUMENT = "Spiegel 2018, tables 6.1 and 6.2, figures 6.14 and 6.15; CANaerospace 1.7, section 4; layout by DBC"
MESSAGES = {
    "insert_point": "answer of a node: point stored, or the reason of refusal",
    "modify_point": "answer of a node: point changed, or the reason of refusal",
    "delete_point": "answer of a node: point deleted, or the reason of refusal",
    "read_table": "answer of a node: number of points that follow",
    "point": "one point of a table",
    "set_rate": "answer of a node: rate of a message changed, or the reason of refusal",
    "(other)": "raw counts and deflections, by the message's name in the DBC",
}
CARRIERS = frozenset({"can"})
_SURFACE = "control surface or pilot's control, as the DBC names it: elevator, flaps, stick_aileron and so on"
_RAW = f"raw count of the point, 0 to {table.MAX_RAW}"
_DEG = f"deflection [deg], {table.MIN_DEG} to {table.MAX_DEG}, kept to 0.01"
COMMANDS = {
    "insert_point": Command("add a point to a table", {"surface": _SURFACE, "raw": _RAW, "deg": _DEG}),
    "modify_point": Command("change the deflection of a point", {"surface": _SURFACE, "raw": _RAW, "deg": _DEG}),
    "delete_point": Command("remove a point from a table", {"surface": _SURFACE, "raw": _RAW}),
    "read_table": Command("request the table of a node", {"surface": _SURFACE}),
    "set_rate": Command(
        "set the message rate of a sensor", {"surface": _SURFACE, "rate_hz": f"[Hz], {MIN_RATE_HZ} to {MAX_RATE_HZ}"}
    ),
}
READ_EVERY_S = 60.0
#: Makes the request of a command from the bus, the sensor and the arguments.
Request = Callable[[PickupBus, Pickup, Mapping[str, str]], Service]


class Options(StrictModel):
    """Options of the pickups of one bus."""

    dbc_file: Annotated[
        str | None, key("file of a DBC that describes the messages; none: the text in dbc", NO_UNIT, "pickups.dbc")
    ] = None
    dbc: Annotated[str, key("text of the DBC, filled in from dbc_file; empty: the built-in one", NO_UNIT)] = ""
    calibration_file: Annotated[
        str | None,
        key("file of calibration tables (CSV); none: the text in calibration", NO_UNIT, "calibrations/pickups.csv"),
    ] = None
    calibration: Annotated[
        str,
        key("text of the calibration tables, filled in from calibration_file; empty: those of the nodes", NO_UNIT),
    ] = ""
    nodes: Annotated[
        tuple[str, ...], key("micro-controllers on this bus, as named in the DBC; empty: all of the DBC", NO_UNIT)
    ] = ()
    silent_after: Annotated[
        float, Field(ge=2, le=1000), key("message periods without a message until a node is reported as silent", ONE)
    ] = 5.0


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder.  Raises ValueError for a wrong DBC or calibration."""
    bus = _bus(options)
    return Decoder(bus, table.read_tables(options.calibration, _all_surfaces(options)), options.silent_after)


def make_encoder(options: Options) -> Encoder:
    """The nodes; those without a table in the calibration have the default (``table.factory_tables``)."""
    bus = _bus(options)
    return Encoder(bus, factory_tables(bus.sensors) | table.read_tables(options.calibration, _all_surfaces(options)))


#: Only the calibration tables are requested.
SENDS_UNASKED = True


def on_connect(options: Options) -> list[bytes]:
    """Request all tables of all nodes."""
    bus = _bus(options)
    return [] if bus.request is None else [_read_all(bus.request)]


def poll(options: Options) -> tuple[float, bytes] | None:
    """The same every minute: a node may have been calibrated at its own connector, or restarted."""
    bus = _bus(options)
    return None if bus.request is None else (READ_EVERY_S, _read_all(bus.request))


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The frame of a command.  Raises ValueError when it or an argument is unknown, missing or out of range."""
    check_complete(COMMANDS, name, args)
    bus = _bus(options or Options())
    if bus.request is None:
        raise ValueError(f"{name}: the DBC has no message node_service_request")
    try:
        sensor = _sensor(bus, args["surface"])
        return wire.pack_service(bus.request, _REQUESTS[name](bus, sensor, args))
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _bus(options: Options) -> PickupBus:
    return read_bus(options.dbc, options.nodes)


def _all_surfaces(options: Options) -> tuple[str, ...]:
    """Surfaces of all buses: one calibration file serves all of them."""
    return tuple(read_bus(options.dbc, ()).sensors)


def _read_all(word: int) -> bytes:
    return wire.pack_service(word, Service(wire.ALL_NODES, wire.READ, wire.ALL_SENSORS))


def _sensor(bus: PickupBus, surface: str) -> Pickup:
    if surface not in bus.sensors:
        raise ValueError(f"surface = {surface!r}; on this bus are {', '.join(sorted(bus.sensors))}")
    return bus.sensors[surface]


def _point_request(service: int) -> Request:
    def request(_: PickupBus, sensor: Pickup, args: Mapping[str, str]) -> Service:
        point = wire.pack_point(table.read_raw(args["raw"]), table.read_degrees(args.get("deg", "0")))
        return Service(sensor.node_id, service, sensor.number, wire.POINT_TYPE, point)

    return request


def _rate_request(bus: PickupBus, sensor: Pickup, args: Mapping[str, str]) -> Service:
    rate = number_or_nan(args["rate_hz"])
    if not MIN_RATE_HZ <= rate <= MAX_RATE_HZ:
        raise ValueError(f"rate_hz = {args['rate_hz']!r}; allowed is {MIN_RATE_HZ} to {MAX_RATE_HZ}")
    carrying = (m for m in bus.messages.values() if sensor.surface in m.deflection or sensor.surface in m.raw)
    return wire.interval_request(sensor.node_id, next(carrying).layout.can_id, round(1000.0 / rate))


_REQUESTS: dict[str, Request] = {
    "insert_point": _point_request(wire.INSERT),
    "modify_point": _point_request(wire.MODIFY),
    "delete_point": _point_request(wire.DELETE),
    "read_table": lambda _bus, sensor, _args: Service(sensor.node_id, wire.READ, sensor.number),
    "set_rate": _rate_request,
}
