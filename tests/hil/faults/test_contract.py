"""Every kind of fault is there: it changes what leaves in its interval, and nothing outside it.

The flights differ by the fault alone, so that what leaves outside the interval is the same to the byte.  What reaches
beyond it, and why, stands in ``REACHES_ON`` and ``NUMBERS_WHAT_IT_SENDS``.
"""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import TypeAdapter

from fti.hil.faults.fitting import why_not
from fti.hil.faults.kinds import Fault, FaultKind, OnDevices
from fti.types import DeviceStatus, Measurement, Reading
from tests.hil.faults.flown import DEVICES, Flight, bound_of, fly, nominal

FROM_S, TO_S = 2.0, 3.5
BACK_S = 0.15  # between a sample and its message, and a cycle
MAKE: TypeAdapter[Fault] = TypeAdapter(Fault)
#: Parameters of the kinds that a device has on its line; those that need none are given by their kind.
ON_THE_LINE: dict[FaultKind, dict[str, Any]] = {
    FaultKind.CUT: {},
    FaultKind.FREEZE: {},
    FaultKind.STUCK: {},
    FaultKind.INVALID: {},
    FaultKind.BIAS: {},
    FaultKind.RAMP: {},
    FaultKind.NOISE: {},
    FaultKind.WRONG_UNIT: {"factor": 0.3048},
    FaultKind.FORCED: {},
    FaultKind.FOG: {"visibility_m": 10.0},
    FaultKind.CLOCK_JUMP: {"by_s": 3.0},
    FaultKind.CLOCK_DRIFT: {"ppm": 20_000.0},
    FaultKind.BIT_ERRORS: {"rate": 0.05},
    FaultKind.LOST_HEADER: {},
    FaultKind.TRUNCATED: {},
    FaultKind.DUPLICATED: {},
    FaultKind.REORDERED: {},
    FaultKind.WRONG_CHECKSUM: {},
    FaultKind.WRONG_LABEL: {},
    FaultKind.BURST: {"hold_s": 0.5},
    FaultKind.BUS_OFF: {},
}
#: Kinds of one number, and the parameter that is as large as the error of the device.
ON_QUANTITY = {
    FaultKind.BIAS: "value",
    FaultKind.RAMP: "rate",
    FaultKind.NOISE: "sd",
    FaultKind.WRONG_UNIT: None,
    FaultKind.FORCED: "value",
}
#: What is tried elsewhere, and where: it does not act between a device's measurement and its line.
ELSEWHERE = {
    FaultKind.OBSTACLE: "tests/hil/test_world.py",
    FaultKind.OFF_TRACK: "tests/hil/flight/test_trajectory.py",
    FaultKind.GNSS_OUTAGE: "tests/hil/faults/test_gnss_faults.py",
    FaultKind.GNSS_DEGRADED: "tests/hil/faults/test_gnss_faults.py",
    FaultKind.GNSS_OFFSET: "tests/hil/faults/test_gnss_faults.py",
    FaultKind.BABBLING: "tests/hil/faults/test_buses.py",
    FaultKind.CAN_STATUS: "tests/hil/test_emulator.py",
    FaultKind.BREAKER: "tests/hil/test_power.py",
    FaultKind.BROWN_OUT: "tests/hil/test_power.py",
}
#: What a drift has gained stays.
REACHES_ON = {FaultKind.CLOCK_DRIFT}
#: What these do not measure they leave out: afterwards their messages are numbered, and of a DBC ordered, otherwise.
NUMBERS_WHAT_IT_SENDS = {"canaerospace", "dbc", "deflection_pickups", "mavlink"}
#: It says the same all the time while no breaker moves.
ALWAYS_THE_SAME = {"power_unit"}


def made(kind: FaultKind, name: str, **changes: Any) -> Fault:
    """The fault of that kind for a device of ``DEVICES``."""
    table = {"kind": kind.value, "from_s": FROM_S, "to_s": TO_S, **ON_THE_LINE[kind], **changes}
    if kind in ON_QUANTITY:
        table |= {"quantity": DEVICES[name].quantity, "name": DEVICES[name].name}
        if (key := ON_QUANTITY[kind]) is not None:
            table[key] = DEVICES[name].forced if kind is FaultKind.FORCED else DEVICES[name].size
    return MAKE.validate_python(table)


def can_be(kind: FaultKind, name: str) -> bool:
    fault, bound = made(kind, name), bound_of(name)
    on_can = {"can"} == bound.driver.CARRIERS
    if kind is FaultKind.BUS_OFF:
        return on_can
    if kind is FaultKind.FOG:
        return DEVICES[name].quantity.startswith("range.")
    if kind in (FaultKind.FREEZE, FaultKind.STUCK) and name in ALWAYS_THE_SAME:
        return False
    if kind is FaultKind.INVALID:
        return name not in ("power_unit", "honeywell_hmr2300")  # neither says that it measures nothing
    return isinstance(fault, OnDevices) and not why_not(fault, bound)


CASES = [(kind, name) for kind in ON_THE_LINE for name in DEVICES if can_be(kind, name)]


def inside(flight: Flight) -> Flight:
    return [(t, messages) for t, messages in flight if FROM_S <= t <= TO_S + BACK_S]


def before(flight: Flight) -> Flight:
    return [(t, messages) for t, messages in flight if t < FROM_S]


def after(flight: Flight) -> Flight:
    return [(t, messages) for t, messages in flight if t > TO_S + BACK_S]


def said(name: str, flight: Flight) -> list[Measurement]:
    """What a decoder makes of a flight, sorted, but for what it says of lost messages."""
    bound = bound_of(name)
    decoder = bound.driver.make_decoder(bound.options)
    found = [m for t, messages in flight for message in messages for m in decoder.feed(message, round(t * 1e9))]
    return sorted((m for m in found if not isinstance(m, DeviceStatus | Reading)), key=repr)


def test_every_kind_is_tried_here_or_elsewhere() -> None:
    assert set(ON_THE_LINE) | set(ELSEWHERE) == set(FaultKind)
    assert not set(ON_THE_LINE) & set(ELSEWHERE)


@pytest.mark.parametrize("kind", ON_THE_LINE)
def test_every_kind_can_be_of_some_device(kind: FaultKind) -> None:
    assert [name for case, name in CASES if case is kind]


@pytest.mark.parametrize(("kind", "name"), CASES)
def test_a_fault_changes_what_leaves_in_its_interval_and_nothing_before_or_behind(kind: FaultKind, name: str) -> None:
    without, spoiled = nominal(name), fly(name, made(kind, name))
    assert inside(without)
    assert inside(spoiled) != inside(without)
    assert before(spoiled) == before(without)
    if kind in REACHES_ON:
        assert after(spoiled) != after(without)
    elif kind is FaultKind.INVALID and name in NUMBERS_WHAT_IT_SENDS:
        assert said(name, after(spoiled)) == said(name, after(without))
        assert said(name, after(spoiled))
    else:
        assert after(spoiled) == after(without)
