"""Layout of the pickups from the DBC: sensors of each micro-controller, and their signals.

    signal <surface>_raw          raw count          signal <surface>_deflection    deg or rad
    signal node_id                number of the node, if frames carry it
    signal message_code           rolling counter, if frames carry it
    sender of the message         the micro-controller; its number is the attribute NodeId, or its position in BU_
    order of the raw signals      the number of a sensor on its node, 0 to 3
    messages node_service_request, node_service_response       requests to the nodes (``service``)

A surface with a raw signal and without deflection belongs to a node that sends raw counts only.
"""

from __future__ import annotations

import importlib.resources
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from fti.canframe import EXTENDED
from fti.formats.dbc_messages import DbcMessage, DbcSignal, read_dbc, read_layouts
from fti.formats.quantities import UNITS

RAW, DEFLECTION = "_raw", "_deflection"
REQUEST, RESPONSE = "node_service_request", "node_service_response"
NODE_ID, COUNTER = "node_id", "message_code"
SENSORS = 4


@dataclass(frozen=True, slots=True)
class Pickup:
    """One pickup.  number : on its node; raw_only : its node does not calibrate."""

    surface: str
    node: str
    node_id: int
    number: int
    raw_only: bool


@dataclass(frozen=True, slots=True)
class PickupMessage:
    """One message of a node, and the signals of the surfaces in it."""

    layout: DbcMessage
    node: str
    node_id: int
    raw: Mapping[str, DbcSignal]
    deflection: Mapping[str, tuple[DbcSignal, float]]  # and the factor to rad
    own_id: DbcSignal | None
    counter: DbcSignal | None


@dataclass(frozen=True, slots=True)
class PickupBus:
    """The pickups of one bus, their messages by word; words of the node service (None: not available)."""

    sensors: Mapping[str, Pickup]
    messages: Mapping[int, PickupMessage]
    request: int | None
    response: int | None

    def find_sensor(self, node_id: int, number: int) -> Pickup | None:
        """The sensor with this number on a node; None if unknown."""
        return next((s for s in self.sensors.values() if (s.node_id, s.number) == (node_id, number)), None)


@cache
def read_bus(text: str, nodes: tuple[str, ...]) -> PickupBus:
    """The pickups of nodes (empty: all) in a DBC (empty: the built-in one).  Raises ValueError with the error."""
    dbc = text or built_in_dbc()
    layouts = read_layouts(dbc)
    senders = sorted({layout.sender for layout in layouts if _surfaces(layout, RAW) | _surfaces(layout, DEFLECTION)})
    for name in nodes:
        if name not in senders:
            raise ValueError(f"nodes: {name!r} has no deflection in the DBC; allowed: {', '.join(senders)}")
    here = [layout for layout in layouts if layout.sender in (nodes or senders)]
    numbers = _numbers(dbc)
    sensors = {s.surface: s for node in senders for s in _sensors(node, numbers, here)}
    if not sensors:
        raise ValueError(f"dbc: no signal is named <surface>{RAW} or <surface>{DEFLECTION}")
    messages = (_message(layout, numbers) for layout in here)
    return PickupBus(
        sensors,
        {_word(m.layout): m for m in messages if m.raw or m.deflection},
        _service_word(layouts, REQUEST),
        _service_word(layouts, RESPONSE),
    )


def built_in_dbc() -> str:
    """The text of the built-in DBC."""
    return importlib.resources.files(__package__).joinpath("pickups.dbc").read_text(encoding="utf-8")


def _numbers(dbc: str) -> dict[str, int]:
    nodes = enumerate(read_dbc(dbc).nodes, 1)
    return {n.name: int(n.dbc.attributes["NodeId"].value) if "NodeId" in n.dbc.attributes else i for i, n in nodes}


def _surfaces(layout: DbcMessage, ending: str) -> set[str]:
    return {s.name.removesuffix(ending) for s in layout.signals if s.name.endswith(ending)}


def _sensors(node: str, numbers: Mapping[str, int], layouts: list[DbcMessage]) -> list[Pickup]:
    own = [layout for layout in layouts if layout.sender == node]
    named = [s.name for layout in own for s in layout.signals]
    calibrated = [n.removesuffix(DEFLECTION) for n in named if n.endswith(DEFLECTION)]
    raw = [n.removesuffix(RAW) for n in named if n.endswith(RAW)]
    surfaces = raw + [s for s in calibrated if s not in raw]
    if len(surfaces) > SENSORS:
        raise ValueError(f"dbc: node {node!r} has {len(surfaces)} sensors; at most {SENSORS} are allowed")
    return [Pickup(s, node, numbers.get(node, 0), i, s not in calibrated) for i, s in enumerate(surfaces)]


def _message(layout: DbcMessage, numbers: Mapping[str, int]) -> PickupMessage:
    signals = {s.name: s for s in layout.signals}
    return PickupMessage(
        layout=layout,
        node=layout.sender,
        node_id=numbers.get(layout.sender, 0),
        raw={s: signals[s + RAW] for s in _surfaces(layout, RAW)},
        deflection={
            s: (signals[s + DEFLECTION], _to_rad(signals[s + DEFLECTION])) for s in _surfaces(layout, DEFLECTION)
        },
        own_id=signals.get(NODE_ID),
        counter=signals.get(COUNTER),
    )


def _to_rad(signal: DbcSignal) -> float:
    if signal.unit not in ("deg", "rad"):
        raise ValueError(f"dbc: signal {signal.name!r}: unit {signal.unit!r}; allowed here: deg, rad")
    return UNITS[signal.unit][0]


def _word(layout: DbcMessage) -> int:
    return layout.can_id | EXTENDED * layout.extended


def _service_word(layouts: tuple[DbcMessage, ...], name: str) -> int | None:
    return next((_word(layout) for layout in layouts if layout.name == name), None)
