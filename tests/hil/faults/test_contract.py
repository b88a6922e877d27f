"""Every kind of fault is there: it changes what leaves in its interval, and nothing outside it.

The flights differ by the fault alone, so that what leaves outside the interval is the same to the byte.  What reaches
beyond it, and why, stands in ``REACHES_ON`` and ``NUMBERS_WHAT_IT_SENDS``.
"""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import TypeAdapter

from fti.devices import gives_scans
from fti.hil.faults.applicability import inapplicable_reason
from fti.hil.tables.fault_base import DeviceFault
from fti.hil.tables.fault_types import Fault, FaultKind
from fti.hil.tables.quantity_names import quantities
from fti.messages.measurements import DeviceStatus, Measurement, Reading
from tests.helpers import ROOT
from tests.hil.faults.device_flights import (
    DEVICES,
    DURATION_S,
    POLLED,
    TIMING,
    Flight,
    bind_device,
    fly,
    make_sensor,
    nominal,
    recorded_cycles,
)
from tests.hil.worlds import world

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
    FaultKind.SCALE: {"percent": 50.0},
    FaultKind.FORCED: {},
    FaultKind.LATENCY: {"by_s": 1.0},
    FaultKind.SWAPPED_COORDINATES: {},
    FaultKind.UNDULATION: {"stated": "zero"},
    FaultKind.ATTITUDE_OFFSET: {"roll_deg": 20.0, "pitch_deg": 20.0, "heading_deg": 20.0},
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
    FaultKind.SCALE: None,
    FaultKind.FORCED: "value",
}
#: What acts before a device measures: the world is another one, or what the receiver hears.  The device that feels it,
#: the parameters, and when it begins; a world is another one from the beginning.
BEFORE_THE_DEVICE: dict[FaultKind, tuple[str, dict[str, Any], float]] = {
    FaultKind.OBSTACLE: ("freeflight_ra4500", {"before_threshold_m": 4300.0, "height_m": 150.0}, 0.0),
    FaultKind.OFF_TRACK: ("nmea0183", {"right_m": 200.0, "from_s": FROM_S, "to_s": TO_S, "turn_s": 1.0}, 0.0),
    FaultKind.GNSS_OUTAGE: ("nmea0183", {"from_s": FROM_S, "to_s": TO_S}, FROM_S),
    FaultKind.GNSS_DEGRADED: (
        "nmea0183", {"from_s": FROM_S, "to_s": TO_S, "horizontal_m": 50.0, "vertical_m": 90.0}, FROM_S,
    ),
    FaultKind.TERRAIN_SHIFT: ("freeflight_ra4500", {"up_m": -15.0}, 0.0),
    FaultKind.GNSS_OFFSET: ("nmea0183", {"from_s": FROM_S, "to_s": TO_S, "north_m": 500.0}, FROM_S),
    FaultKind.GNSS_RAMP: ("nmea0183", {"from_s": FROM_S, "to_s": TO_S, "east_mps": 20.0}, FROM_S),
    FaultKind.LEVER_ARM: ("nmea0183", {"from_s": FROM_S, "to_s": TO_S, "forward_m": 10.0}, FROM_S),
    FaultKind.MOUNTING: ("lightware_ascii", {"from_s": FROM_S, "to_s": TO_S, "roll_deg": 20.0}, FROM_S),
    FaultKind.INERTIAL_BIAS: ("mavlink", {"from_s": FROM_S, "to_s": TO_S, "accel_mg": (9.0, 0.0, 0.0)}, FROM_S),
}  # fmt: skip
#: What is of links and of power acts behind the device, and is tried there.
BEHIND_THE_DEVICE = {
    FaultKind.BABBLING: "tests/hil/faults/test_buses.py",
    FaultKind.CAN_STATUS: "tests/hil/test_emulator.py",
    FaultKind.BREAKER: "tests/hil/test_power.py",
    FaultKind.BROWN_OUT: "tests/hil/test_power.py",
}
#: What a drift has gained stays.
REACHES_ON = {FaultKind.CLOCK_DRIFT}
#: What these do not measure they leave out: afterwards their messages are numbered, and of a DBC ordered, otherwise.
NUMBERS_WHAT_IT_SENDS = {"canaerospace", "dbc", "deflection_pickups", "mavlink"}
POSITIONS = {"imar_ixcom", "mavlink", "nmea0183", "novatel_oem6", "ublox_ubx"}
ATTITUDES = {"arinc429_little", "arinc429_apmp", "arinc429_chapter10", "imar_ixcom", "mavlink"}
#: Devices that send what these change.
NEEDS = {
    FaultKind.SWAPPED_COORDINATES: POSITIONS,
    FaultKind.UNDULATION: POSITIONS,
    FaultKind.ATTITUDE_OFFSET: ATTITUDES,
}
#: It says the same all the time while no breaker moves.
ALWAYS_THE_SAME = {"power_unit"}


def make_fault(kind: FaultKind, name: str, **changes: Any) -> Fault:
    """The fault of that kind for a device of ``DEVICES``."""
    table = {"kind": kind.value, "from_s": FROM_S, "to_s": TO_S, **ON_THE_LINE[kind], **changes}
    if kind in ON_QUANTITY:
        table |= {"quantity": DEVICES[name].quantity, "name": DEVICES[name].name}
        if (key := ON_QUANTITY[kind]) is not None:
            table[key] = DEVICES[name].forced if kind is FaultKind.FORCED else DEVICES[name].size
    return MAKE.validate_python(table)


def can_be(kind: FaultKind, name: str) -> bool:
    fault, bound = make_fault(kind, name), bind_device(name)
    on_can = {"can"} == bound.driver.CARRIERS
    if kind is FaultKind.BUS_OFF:
        return on_can
    if kind is FaultKind.FOG:
        return DEVICES[name].quantity.startswith("range.")
    if kind in (FaultKind.FREEZE, FaultKind.STUCK, FaultKind.LATENCY) and name in ALWAYS_THE_SAME:
        return False
    if kind is FaultKind.LATENCY and gives_scans(bound):
        return False  # the model measures late scans: tests/hil/test_range_arrays.py
    if kind in NEEDS:
        return name in NEEDS[kind]
    if kind is FaultKind.INVALID:
        return name not in ("power_unit", "honeywell_hmr2300")  # neither says that it measures nothing
    return isinstance(fault, DeviceFault) and not inapplicable_reason(fault, bound)


CASES = [(kind, name) for kind in ON_THE_LINE for name in DEVICES if name not in POLLED and can_be(kind, name)]


def inside(flight: Flight) -> Flight:
    return [(t, messages) for t, messages in flight if FROM_S <= t <= TO_S + BACK_S]


def before(flight: Flight) -> Flight:
    return [(t, messages) for t, messages in flight if t < FROM_S]


def after(flight: Flight) -> Flight:
    return [(t, messages) for t, messages in flight if t > TO_S + BACK_S]


def decoded(name: str, flight: Flight) -> list[Measurement]:
    """What a decoder makes of a flight, sorted, but for what it says of lost messages."""
    bound = bind_device(name)
    decoder = bound.driver.make_decoder(bound.options)
    measurements = [m for t, messages in flight for message in messages for m in decoder.feed(message, round(t * 1e9))]
    return sorted((m for m in measurements if not isinstance(m, DeviceStatus | Reading)), key=repr)


def test_every_kind_is_tried() -> None:
    tried = [*ON_THE_LINE, *BEFORE_THE_DEVICE, *BEHIND_THE_DEVICE]
    assert len(tried) == len(set(tried))
    assert set(tried) == set(FaultKind)
    for kind, file in BEHIND_THE_DEVICE.items():
        assert f'"{kind}"' in (ROOT / file).read_text(), kind


@pytest.mark.parametrize("kind", BEFORE_THE_DEVICE)
def test_a_fault_of_the_world_or_of_reception_reaches_the_line_and_not_before_its_time(kind: FaultKind) -> None:
    name, parameters, begin_s = BEFORE_THE_DEVICE[kind]
    fault = MAKE.validate_python({"kind": kind.value, **parameters})
    without, spoiled = (
        fly(name, sensor=make_sensor(name, world(DURATION_S, fault=faults, sensor=TIMING))) for faults in ((), (fault,))
    )
    assert [m for m in without if m[0] >= begin_s] != [m for m in spoiled if m[0] >= begin_s]
    assert [m for m in without if m[0] < begin_s] == [m for m in spoiled if m[0] < begin_s]


@pytest.mark.parametrize("kind", ON_THE_LINE)
def test_every_kind_can_be_of_some_device(kind: FaultKind) -> None:
    assert [name for case, name in CASES if case is kind]


@pytest.mark.parametrize(("kind", "name"), CASES)
def test_a_fault_changes_what_leaves_in_its_interval_and_nothing_before_or_behind(kind: FaultKind, name: str) -> None:
    without, spoiled = nominal(name), fly(name, make_fault(kind, name))
    assert inside(without)
    assert inside(spoiled) != inside(without)
    assert before(spoiled) == before(without)
    if kind in REACHES_ON:
        assert after(spoiled) != after(without)
    elif kind is FaultKind.INVALID and name in NUMBERS_WHAT_IT_SENDS:
        assert decoded(name, after(spoiled)) == decoded(name, after(without))
        assert decoded(name, after(spoiled))
    else:
        assert after(spoiled) == after(without)


@pytest.mark.parametrize("name", [name for name in DEVICES if name not in POLLED])
def test_no_number_is_too_wrong_to_be_forced(name: str) -> None:
    """Every number that the device measures, in turn, far too small and far too large: it goes on to the end."""
    kinds = {type(m) for cycle in recorded_cycles(name)[:20] for m in cycle}
    numbers = {f"{kind}.{key}": q for kind, fields in quantities().items() for key, q in fields.items()}
    mine = [text for text, found in numbers.items() if found.kind in kinds]
    assert mine
    for value in (-1e30, -1e4, 1e4, 1e30):
        times = [(0.5 + 5.0 * k / len(mine), quantity) for k, quantity in enumerate(mine)]
        tables = [{"quantity": q, "value": value, "from_s": t, "to_s": t + 0.15} for t, q in times]
        faults = [MAKE.validate_python({"kind": "forced", **table}) for table in tables]
        assert fly(name, *faults)[-1][0] == nominal(name)[-1][0]
