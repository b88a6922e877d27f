"""Faults of CAN links: a node that babbles, a bus that is off."""

from __future__ import annotations

import asyncio
from typing import cast

import numpy as np
import pytest

from fti.canframe import EXTENDED, unpack_can
from fti.hil.device_streams import BabbleStream, StatusStream
from fti.hil.ports.endpoints import Endpoint, SlcanEndpoint
from fti.hil.tables.fault_types import Babbling, BusOff
from fti.links.slcan_status import FLAGS
from tests.hil.faults.device_flights import fly, nominal


class Bus:
    """Keeps what is sent on it, and which flags were raised."""

    def __init__(self) -> None:
        self.frames: list[bytes] = []
        self.flags = 0

    def send(self, data: bytes) -> None:
        self.frames.append(data)

    def raise_flags(self, flags: int) -> None:
        self.flags |= flags


def run_out(stream: BabbleStream | StatusStream) -> list[float]:
    """Let a stream send everything; its instants."""
    instants = []
    while (due := stream.due_s()) is not None:
        instants.append(due)
        asyncio.run(stream.send())
    return instants


def test_a_node_babbles_at_its_rate_in_the_interval() -> None:
    buses = [Bus(), Bus()]
    fault = Babbling(kind="babbling", from_s=2.0, to_s=2.1, rate_hz=2000.0, can_id=17)
    instants = run_out(BabbleStream(fault, cast(list[Endpoint], buses)))
    np.testing.assert_allclose(instants, 2.0 + np.arange(200) / 2000.0, atol=1e-9)
    for bus in buses:
        assert len(bus.frames) == 200
        assert {unpack_can(frame).can_id for frame in bus.frames} == {17}


def test_an_identifier_of_more_than_eleven_bits_is_extended() -> None:
    bus = Bus()
    fault = Babbling(kind="babbling", from_s=0.0, to_s=0.001, rate_hz=1000.0, can_id=0x18FF0001)
    run_out(BabbleStream(fault, cast(list[Endpoint], [bus])))
    assert int.from_bytes(bus.frames[0][:4], "little") == 0x18FF0001 | EXTENDED


@pytest.mark.parametrize("links", [(), ("line",), ("line", "other")])
def test_on_a_bus_that_is_off_no_device_is_received(links: tuple[str, ...]) -> None:
    flight = fly("canaerospace", BusOff(kind="bus_off", links=links, from_s=2.0, to_s=4.0))
    assert flight == [(t, m) for t, m in nominal("canaerospace") if not 2.0 <= t < 4.0]


def test_other_buses_and_lines_are_not_touched() -> None:
    assert fly("canaerospace", BusOff(kind="bus_off", links=("other",), from_s=2.0, to_s=4.0)) == nominal(
        "canaerospace"
    )
    assert fly("nmea0183", BusOff(kind="bus_off", from_s=2.0, to_s=4.0)) == nominal("nmea0183")


def test_an_adapter_reports_the_errors_of_its_bus() -> None:
    bus = Bus()
    stream = StatusStream(BusOff(kind="bus_off", from_s=2.0, to_s=3.0), cast(list[SlcanEndpoint], [bus]))
    assert run_out(stream) == [2.0, 2.25, 2.5, 2.75]
    names = {name for bit, name in FLAGS.items() if bus.flags & bit}
    assert names == {"slcan_error_warning", "slcan_error_passive", "slcan_bus_error"}
