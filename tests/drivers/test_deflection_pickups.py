"""Deflection pickups: tables, commands to the node and their answers, raw counts only, user-defined layouts."""

from __future__ import annotations

import itertools
import math
import re
import struct
from collections.abc import Iterable, Mapping
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.canframe import pack_can, unpack_can
from fti.drivers import canaerospace
from fti.drivers import deflection_pickups as pickups
from fti.drivers.deflection_pickups import layout, service
from fti.drivers.deflection_pickups.table import MAX_POINTS, MIN_POINTS, CalibrationTable, read_tables
from fti.messages.measurements import Ack, Calibration, DeviceStatus, Measurement, Stamp, SurfaceDeflection
from tests.helpers import ROOT

MS = 1_000_000
CALIBRATION = (ROOT / "configs/calibrations/da42_pickups.csv").read_text()
SHIPPED = ROOT / "configs/dbc/deflection_pickups.dbc"
FLAPS = "surface,raw,deg\nflaps,500,0\nflaps,2500,20\nflaps,3500,40\n"
#: Without the deflections of the flaps: that node sends raw counts only.
RAW_FLAPS = re.sub(r"(BO_ \d+ flaps_deflection.*?\n\n|(CM_ SG_|SIG_VALTYPE_) \d+ flaps_deflection.*?\n)", "",
                   layout.built_in_dbc(), flags=re.DOTALL)  # fmt: skip
SURFACES = (
    "left_aileron", "right_aileron", "flaps", "elevator", "rudder", "rudder_trim", "stick_aileron", "stick_elevator",
    "pedals", "elevator_trim",
)  # fmt: skip


def options(**keys: Any) -> pickups.Options:
    return pickups.Options(**keys)


def deflection(surface: str, raw: int | None = None, deg: float | None = None, t_ns: int = 0) -> SurfaceDeflection:
    angle = None if deg is None else math.radians(deg)
    return SurfaceDeflection(stamp=Stamp(t_ns), surface=surface, raw=raw, deflection=angle)


class Rig:
    """Nodes at one end, a decoder at the other; ``sent`` is what a recorder would have."""

    def __init__(self, **keys: Any) -> None:
        self.options = options(**keys)
        self.nodes, self.decoder = pickups.make_encoder(self.options), pickups.make_decoder(self.options)
        self.sent: list[bytes] = []

    def send(self, name: str, **args: str) -> list[Measurement]:
        """A command: what comes of it."""
        return self.take(self.nodes.respond(pickups.command(name, args, self.options)))

    def measure(self, surface: str, raw: int) -> list[Measurement]:
        return self.take(self.nodes.encode(deflection(surface, raw)))

    def take(self, frames: Iterable[bytes]) -> list[Measurement]:
        measurements: list[Measurement] = []
        for frame in frames:
            self.sent.append(frame)
            measurements += self.decoder.feed(frame, len(self.sent) * MS)
        return measurements


def one(measurements: list[Measurement], kind: type[Any]) -> Any:
    (only,) = [m for m in measurements if isinstance(m, kind)]
    return only


def degrees(results: list[Measurement]) -> float | None:
    measurements: float | None = one(results, SurfaceDeflection).deflection
    return None if measurements is None else math.degrees(measurements)


# ------------------------------------------------------------------------------------------------------- tables


@pytest.mark.parametrize(
    ("raw", "deg"),
    [(500, 0.0), (1500, 10.0), (2500, 20.0), (2501, 20.02), (3500, 40.0), (499, None), (3501, None), (0, None)],
)
def test_between_points_a_line_and_outside_nothing(raw: int, deg: float | None) -> None:
    """20 degrees over 2000 counts, then 20 over 1000."""
    measurements = read_tables(FLAPS, ["flaps"])["flaps"].deflection(raw)
    assert measurements == (None if deg is None else pytest.approx(math.radians(deg), abs=1e-9))


points = st.lists(st.tuples(st.integers(0, 65_535), st.integers(-32_768, 32_767)), max_size=40)


@given(points, st.integers(0, 65_535))
def test_a_table_is_monotone_or_none(found: list[tuple[int, int]], raw: int) -> None:
    pairs = list(itertools.pairwise(found))
    falling = all(a[1] > b[1] for a, b in pairs)
    good = all(a[0] < b[0] for a, b in pairs) and (falling or all(a[1] < b[1] for a, b in pairs))
    if not good or not MIN_POINTS <= len(found) <= MAX_POINTS:
        with pytest.raises(ValueError, match=r"points|ascending|monotone"):
            CalibrationTable(tuple(found))
        return
    angle = CalibrationTable(tuple(found)).deflection(raw)
    inside = found[0][0] <= raw <= found[-1][0]
    assert (angle is not None) == inside
    if angle is not None:
        ends = sorted((found[0][1], found[-1][1]))
        assert ends[0] - 1e-6 <= 100 * math.degrees(angle) <= ends[1] + 1e-6


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("flaps,1,2\n", "calibration: line 1: must be the header surface,raw,deg"),
        ("surface,raw,deg\n# flaps,1,2\n", "calibration: contains no point; it needs the header surface,raw,deg"),
        (" ", "calibration: contains no point"),
        ("surface,raw,deg\nflaps,1\n", "calibration: line 2: 2 values; must be surface,raw,deg"),
        ("surface,raw,deg\n# a note\nflap,1,2\n", "calibration: line 3: surface 'flap'; there are flaps, rudder"),
        ("surface,raw,deg\nflaps,-1,2\n", "calibration: line 2: raw = '-1'; allowed is 0 to 65535"),
        ("surface,raw,deg\nflaps,1,400\n", "calibration: line 2: deg = '400'; allowed is -327.68 to 327.67"),
        ("surface,raw,deg\nflaps,1,x\n", "calibration: line 2: deg = 'x'; allowed is"),
        ("surface,raw,deg\nflaps,1,2\n", "calibration: flaps: 1 points; a table has 2 to 32"),
        ("surface,raw,deg\nflaps,1,2\nflaps,1,3\n", "calibration: flaps: raw counts must be ascending"),
        ("surface,raw,deg\nflaps,1,2\nflaps,2,3\nflaps,3,3\n", "calibration: flaps: deflections must be strictly mono"),
    ],
)
def test_a_wrong_calibration_is_refused_in_a_sentence(text: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=re.escape(sentence)):
        read_tables(text, ["flaps", "rudder"])


def test_a_calibration_from_a_spreadsheet_is_read() -> None:
    assert read_tables("\ufeff" + FLAPS.replace("\n", "\r\n"), ["flaps"]) == read_tables(FLAPS, ["flaps"])


def test_the_shipped_calibration_has_a_table_for_every_surface() -> None:
    assert set(read_tables(CALIBRATION, SURFACES)) == set(SURFACES)


# ------------------------------------------------------------------------------------------------ what nodes send


def test_raw_count_and_deflection_of_a_sample_are_one_measurement() -> None:
    rig = Rig(calibration=FLAPS)
    measurements = rig.measure("flaps", 3000)
    assert one(measurements, SurfaceDeflection).raw == 3000
    assert degrees(measurements) == pytest.approx(30.0, abs=1e-5)
    assert [unpack_can(frame).can_id for frame in rig.sent] == [1605, 1501]


def test_counts_of_another_sample_do_not_belong_to_a_deflection() -> None:
    nodes, decoder = pickups.make_encoder(options()), pickups.make_decoder(options())
    first, second = nodes.encode(deflection("rudder", 2000)), nodes.encode(deflection("rudder", 2100))
    measurements = [m for frame in (first[0], second[1]) for m in decoder.feed(frame, 1)]
    assert one(measurements, SurfaceDeflection).raw is None


def test_a_count_belongs_to_one_deflection_only() -> None:
    """Where nothing counts, a raw count that came no more would stay beside every later deflection."""
    uncounted = OWN.replace("BO_ 2147484000 box_values: 8 box\n SG_ left_flap_raw : 0|16@1+",
                            "BO_ 100 counts: 8 box\n SG_ left_flap_raw : 0|16@1+").replace(
        " SG_ left_flap_deflection", "\nBO_ 101 angles: 8 box\n SG_ left_flap_deflection")  # fmt: skip
    decoder = pickups.make_decoder(options(dbc=uncounted))
    frames = (pack_can(100, bytes([7, *bytes(7)])), pack_can(101, bytes(8)), pack_can(101, bytes(8)))
    measurements = [m for frame in frames for m in decoder.feed(frame, 1)]
    assert [m.raw for m in measurements if isinstance(m, SurfaceDeflection) and m.surface == "left_flap"] == [7, None]


def test_the_ten_pickups_of_table_6_2_are_there_with_their_buses() -> None:
    bus_1 = layout.read_bus("", ("left_wing", "flaps", "pilot_controls"))
    bus_2 = layout.read_bus("", ("tail", "right_wing"))
    assert set(bus_2.sensors) == {"elevator", "rudder", "rudder_trim", "right_aileron"}
    assert set(bus_1.sensors) | set(bus_2.sensors) == set(SURFACES)
    assert not set(bus_1.sensors) & set(bus_2.sensors)
    assert all(s.number < 4 for s in (*bus_1.sensors.values(), *bus_2.sensors.values()))


def test_the_shipped_dbc_is_the_built_in_one() -> None:
    assert SHIPPED.read_text() == layout.built_in_dbc()


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (pack_can(300, bytes(8)), "other_id"),
        (pack_can(306, bytes([21, 2, 0])), "bad_data"),
        (pack_can(306, bytes([22, 2, 0, 0]) + bytes(4)), "other_node"),
        (pack_can(306, bytes([21, 12, 0, 0]) + bytes(4)), "bad_data"),  # SHORT2 is not what the DBC says
        (pack_can(129, bytes([99, 16, 0, 0]) + bytes(4)), "other_node"),
        (pack_can(129, bytes([21, 0, 100, 0])), "bad_data"),  # an answer without a point
        (pack_can(129, bytes([21])), "bad_data"),
        (pack_can(306, bytes(8), remote=True), "remote_frame"),
        (b"\x01", "no_frame"),
    ],
)
def test_frames_that_say_nothing_are_counted_by_reason(frame: bytes, reason: str) -> None:
    decoder = pickups.make_decoder(options())
    assert decoder.feed(frame, 1) == []
    assert decoder.counters.skipped == {reason: len(frame)}


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_deflection_that_is_no_number_is_not_valid(value: float) -> None:
    decoder = pickups.make_decoder(options())
    measurements = decoder.feed(pack_can(306, bytes([21, 2, 0, 0]) + struct.pack(">f", value)), 1)
    assert (one(measurements, SurfaceDeflection).deflection, one(measurements, SurfaceDeflection).valid) == (
        None,
        False,
    )


def test_lost_messages_and_silent_nodes_are_reported() -> None:
    nodes, decoder = pickups.make_encoder(options()), pickups.make_decoder(options())
    measurements: list[Measurement] = []
    for n in range(30):
        frames = nodes.encode(deflection("left_aileron", 2000))
        lost = 5 <= n < 8 or n >= 15
        for frame in [] if lost else frames:
            measurements += decoder.feed(frame, 1 + 100 * n * MS)
        for frame in nodes.encode(deflection("elevator", 2000)):
            measurements += decoder.feed(frame, 1 + 100 * n * MS + 1)
    reported = [flag for m in measurements if isinstance(m, DeviceStatus) for flag in m.flags]
    assert reported == ["left_aileron_raw_lost_3", "left_aileron_deflection_lost_3", "node_left_wing_silent"]
    assert decoder.counters.lost == {"left_aileron_raw": 3, "left_aileron_deflection": 3}


# ------------------------------------------------------------------------------------------------ raw counts only


def test_where_a_node_sends_raw_counts_only_the_table_is_applied_here() -> None:
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    measurements = rig.measure("flaps", 1500)
    assert [unpack_can(frame).can_id for frame in rig.sent] == [1605]
    assert degrees(measurements) == pytest.approx(10.0, abs=1e-9)
    assert one(measurements, SurfaceDeflection).raw == 1500
    assert one(rig.measure("elevator", 2000), SurfaceDeflection).valid


@pytest.mark.parametrize("raw", [499, 3501, 65_535])
def test_outside_the_table_nothing_is_extrapolated(raw: int) -> None:
    measurements = one(Rig(dbc=RAW_FLAPS, calibration=FLAPS).measure("flaps", raw), SurfaceDeflection)
    assert (measurements.deflection, measurements.raw, measurements.valid) == (None, raw, False)


def test_without_a_table_a_raw_count_is_no_deflection() -> None:
    measurements = one(Rig(dbc=RAW_FLAPS).measure("flaps", 2000), SurfaceDeflection)
    assert (measurements.deflection, measurements.raw, measurements.valid) == (None, 2000, False)


def test_a_node_that_calibrates_sends_no_deflection_outside_its_table() -> None:
    rig = Rig(calibration=FLAPS)
    assert rig.measure("flaps", 100) == []
    assert rig.decoder.counters.messages == {"flaps_raw": 1}


# ------------------------------------------------------------------------------------------------------- commands


def test_a_point_is_inserted_modified_and_deleted() -> None:
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    steps: list[tuple[str, Mapping[str, str], float]] = [
        ("insert_point", {"surface": "flaps", "raw": "1500", "deg": "12"}, 12.0),
        ("modify_point", {"surface": "flaps", "raw": "1500", "deg": "11.5"}, 11.5),
        ("delete_point", {"surface": "flaps", "raw": "1500"}, 10.0),
    ]
    for name, args, expected in steps:
        measurements = rig.send(name, **args)
        ack, reported = one(measurements, Ack), one(measurements, Calibration)
        assert (ack.command, ack.accepted) == (name, True)
        assert ack.detail.startswith("flaps: raw 1500")
        assert (reported.surface, reported.change.split()[0]) == ("flaps", name)
        assert degrees(rig.measure("flaps", 1500)) == pytest.approx(expected, abs=1e-9)
    assert [p.raw for p in reported.points] == [500, 2500, 3500]


def test_a_node_that_calibrates_uses_what_it_has_stored() -> None:
    rig = Rig(calibration=FLAPS)
    rig.send("insert_point", surface="flaps", raw="1500", deg="12")
    assert degrees(rig.measure("flaps", 1500)) == pytest.approx(12.0, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "args", "reason"),
    [
        ("insert_point", {"raw": "1500", "deg": "20"}, "the table would not be monotone"),
        ("insert_point", {"raw": "500", "deg": "1"}, "a point with this raw count exists"),
        ("modify_point", {"raw": "2500", "deg": "40"}, "the table would not be monotone"),
        ("modify_point", {"raw": "2501", "deg": "21"}, "no point with this raw count"),
        ("delete_point", {"raw": "2501"}, "no point with this raw count"),
    ],
)
def test_what_would_spoil_the_table_is_refused_and_changes_nothing(
    name: str, args: dict[str, str], reason: str
) -> None:
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    ack = one(rig.send(name, surface="flaps", **args), Ack)
    assert (ack.command, ack.accepted) == (name, False)
    assert reason in ack.detail
    assert degrees(rig.measure("flaps", 2500)) == pytest.approx(20.0, abs=1e-9)


def test_two_points_remain_and_more_than_32_are_not_taken() -> None:
    rig = Rig(calibration=FLAPS)
    assert one(rig.send("delete_point", surface="flaps", raw="2500"), Ack).accepted
    refused = one(rig.send("delete_point", surface="flaps", raw="3500"), Ack)
    assert (refused.accepted, refused.detail) == (False, "flaps: refused: fewer than 2 points would remain")
    for n in range(30):
        measurements = rig.send("insert_point", surface="flaps", raw=str(600 + n), deg=str(0.1 + 0.1 * n))
        assert one(measurements, Ack).accepted
    assert one(rig.send("insert_point", surface="flaps", raw="3000", deg="30"), Ack).detail.endswith("table is full")


def test_nothing_changes_before_the_node_has_acknowledged() -> None:
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    request = pickups.command("insert_point", {"surface": "flaps", "raw": "1500", "deg": "12"}, rig.options)
    rig.take([request])  # an echo, or another tool's: it is counted, and no more
    assert degrees(rig.measure("flaps", 1500)) == pytest.approx(10.0, abs=1e-9)
    assert rig.decoder.counters.messages["node_service_request"] == 1
    rig.take(rig.nodes.respond(request))
    assert degrees(rig.measure("flaps", 1500)) == pytest.approx(12.0, abs=1e-9)


def test_what_was_recorded_gives_the_same_again() -> None:
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    measurements = rig.measure("flaps", 1500) + rig.send("insert_point", surface="flaps", raw="1500", deg="12")
    measurements += rig.measure("flaps", 1500) + rig.send("read_table", surface="flaps") + rig.measure("flaps", 1500)
    again = pickups.make_decoder(rig.options)
    assert [m for i, frame in enumerate(rig.sent, 1) for m in again.feed(frame, i * MS)] == measurements


def test_an_acknowledgement_that_comes_twice_changes_the_table_once() -> None:
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    answers = rig.nodes.respond(pickups.command("delete_point", {"surface": "flaps", "raw": "2500"}, rig.options))
    assert [p.raw for p in one(rig.take(answers), Calibration).points] == [500, 3500]
    assert [type(m) for m in rig.take(answers)] == [Ack]


def test_a_table_is_read_from_the_node() -> None:
    """The node has another table than the file here says: after reading it, its own is applied."""
    rig = Rig(dbc=RAW_FLAPS)
    rig.decoder = pickups.make_decoder(options(dbc=RAW_FLAPS, calibration=FLAPS))
    measurements = rig.send("read_table", surface="flaps")
    assert one(measurements, Ack) == Ack(stamp=one(measurements, Ack).stamp, command="read_table", accepted=True,
                                  detail="flaps: 2 points")  # fmt: skip
    assert [p.raw for p in one(measurements, Calibration).points] == [256, 3840]
    assert degrees(rig.measure("flaps", 256)) == pytest.approx(-1.0)
    assert not [m for m in rig.send("read_table", surface="flaps") if isinstance(m, Calibration)]  # nothing new


def test_a_table_of_which_a_point_is_missing_is_not_taken() -> None:
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    answers = rig.nodes.respond(pickups.command("read_table", {"surface": "flaps"}, rig.options))
    measurements = rig.take(answers[:2] + answers[3:])
    assert (one(measurements, Ack).accepted, one(measurements, Ack).detail) == (False, "flaps: a point is missing")
    assert degrees(rig.measure("flaps", 1500)) == pytest.approx(10.0, abs=1e-9)


def test_a_change_that_does_not_fit_shows_that_the_node_has_another_table() -> None:
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    rig.nodes = pickups.make_encoder(options(dbc=RAW_FLAPS, calibration="surface,raw,deg\nflaps,0,50\nflaps,4000,0\n"))
    measurements = rig.send("insert_point", surface="flaps", raw="1000", deg="45")
    assert one(measurements, Ack).accepted
    assert one(measurements, DeviceStatus).flags == ("flaps_table_differs",)
    assert degrees(rig.measure("flaps", 1500)) is None
    rig.send("read_table", surface="flaps")
    assert degrees(rig.measure("flaps", 1000)) == pytest.approx(45.0)


@pytest.mark.parametrize(
    ("node", "name", "args"),
    [
        ("flaps,500,0\nflaps,1500,12\nflaps,3500,40\n", "modify_point", {"raw": "1500", "deg": "13"}),
        ("flaps,400,0\nflaps,3500,40\n", "insert_point", {"raw": "2500", "deg": "25"}),
    ],
)
def test_a_change_of_a_point_that_the_table_here_has_not_shows_it_too(
    node: str, name: str, args: dict[str, str]
) -> None:
    """The node has changed a point that is not here, or had none where there is one here: it has another table."""
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    rig.nodes = pickups.make_encoder(options(dbc=RAW_FLAPS, calibration=f"surface,raw,deg\n{node}"))
    measurements = rig.send(name, surface="flaps", **args)
    assert one(measurements, Ack).accepted
    assert one(measurements, DeviceStatus).flags == ("flaps_table_differs",)
    assert degrees(rig.measure("flaps", 2000)) is None


def test_a_table_that_is_edited_while_it_is_read_is_not_taken() -> None:
    """The points after the edit would be of another table than those before it."""
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    read = rig.nodes.respond(pickups.command("read_table", {"surface": "flaps"}, rig.options))
    rig.take(read[:2])
    rig.send("modify_point", surface="flaps", raw="500", deg="1")
    rig.take(read[2:])
    assert degrees(rig.measure("flaps", 500)) == pytest.approx(1.0)


def test_a_node_without_a_table_says_so() -> None:
    rig = Rig(dbc=RAW_FLAPS, calibration=FLAPS)
    measurements = rig.take([pack_can(129, bytes([24, 16, 103, 0, 0, 0, 0, 0]))])
    assert one(measurements, Ack).detail == "flaps: the node has no table"
    assert not one(measurements, Ack).accepted
    assert degrees(rig.measure("flaps", 1500)) == pytest.approx(10.0)


def test_all_tables_are_read_on_connect_and_every_minute() -> None:
    rig = Rig(calibration=CALIBRATION)
    rig.decoder = pickups.make_decoder(options())
    (request,) = pickups.on_connect(rig.options)
    assert pickups.poll(rig.options) == (60.0, request)
    measurements = rig.take(rig.nodes.respond(request))
    assert {m.surface for m in measurements if isinstance(m, Calibration)} == set(SURFACES)
    assert all(m.accepted for m in measurements if isinstance(m, Ack))


def test_the_rate_is_set_and_kept() -> None:
    rig = Rig()
    measurements = rig.send("set_rate", surface="rudder", rate_hz="5")
    assert one(measurements, Ack).detail == "node tail: message 306 at 5 Hz"
    sent = {"rudder": 0, "elevator": 0}
    for n, surface in itertools.product(range(20), sent):
        sent[surface] += bool(rig.nodes.encode(deflection(surface, 2000, t_ns=100 * MS * n)))
    assert sent == {"rudder": 10, "elevator": 20}


def test_the_nodes_show_who_they_are_to_any_canaerospace_unit() -> None:
    nodes, listener = pickups.make_encoder(options()), canaerospace.make_decoder(canaerospace.Options())
    answers = nodes.respond(canaerospace.command("identify", {"node": "0"}))
    measurements = [m for answer in answers for m in listener.feed(answer, 1)]
    flags = [m.flags[1] for m in measurements if isinstance(m, DeviceStatus)]
    assert flags == ["node_21", "node_22", "node_23", "node_24", "node_25"]


@pytest.mark.parametrize(
    ("name", "args", "sentence"),
    [
        ("insert_point", {"raw": "1", "deg": "1"}, "insert_point: surface is missing: control surface"),
        ("insert_point", {"surface": "flaps", "raw": "1"}, "insert_point: deg is missing: deflection [deg]"),
        (
            "insert_point",
            {"surface": "flap", "raw": "1", "deg": "1"},
            "surface = 'flap'; on this bus are elevator, ele",
        ),
        ("insert_point", {"surface": "flaps", "raw": "70000", "deg": "1"}, "raw = '70000'; allowed is 0 to 65535"),
        ("modify_point", {"surface": "flaps", "raw": "1", "deg": "nan"}, "deg = 'nan'; allowed is -327.68 to 327.67"),
        ("delete_point", {"surface": "flaps", "raw": "1", "deg": "1"}, "delete_point: no argument 'deg'; there are"),
        ("set_rate", {"surface": "flaps", "rate_hz": "0"}, "set_rate: rate_hz = '0'; allowed is 1 to 100"),
        ("set_rate", {"surface": "flaps", "rate_hz": "101"}, "set_rate: rate_hz = '101'; allowed is 1 to 100"),
        ("calibrate", {}, "no command 'calibrate'; there are insert_point, modify_point"),
    ],
)
def test_a_wrong_command_is_refused_in_a_sentence(name: str, args: dict[str, str], sentence: str) -> None:
    with pytest.raises(ValueError, match=re.escape(sentence)):
        pickups.command(name, args, options())


def test_a_command_is_for_the_nodes_of_its_bus() -> None:
    with pytest.raises(ValueError, match="surface = 'flaps'; on this bus are elevator, rudder, rudder_trim"):
        pickups.command("read_table", {"surface": "flaps"}, options(nodes=("tail",)))


def test_the_frame_of_a_command_is_a_node_service() -> None:
    """insert raw 2250, -1.00 deg into the table of the rudder: node 21, sensor 1; 0x08CA, -100."""
    frame = unpack_can(pickups.command("insert_point", {"surface": "rudder", "raw": "2250", "deg": "-1"}, options()))
    assert (frame.can_id, frame.data.hex()) == (128, "15646401" + "08ca" + "ff9c")


@given(st.binary(max_size=8), st.sampled_from([128, 129]))
def test_no_request_and_no_answer_breaks_anything(data: bytes, can_id: int) -> None:
    rig = Rig(calibration=CALIBRATION)
    rig.take([pack_can(can_id, data)])
    for answer in rig.nodes.respond(pack_can(can_id, data)):
        assert unpack_can(answer).can_id == 129


def test_every_result_has_words() -> None:
    assert len(service.RESULTS) == service.POINT_EXISTS + 1
    assert service.Service(1, service.INSERT, 0xF0).result == "refused: result 15"


# -------------------------------------------------------------------------------------------- layouts of one's own

OWN = """VERSION ""

NS_ :

BS_:

BU_: box

BO_ 2147484000 box_values: 8 box
 SG_ left_flap_raw : 0|16@1+ (1,0) [0|4095] "" Vector__XXX
 SG_ left_flap_deflection : 16|16@1- (0.01,0) [-10|60] "deg" Vector__XXX
 SG_ right_flap_raw : 32|16@1+ (1,0) [0|4095] "" Vector__XXX
"""


def test_a_makers_own_layout_is_a_dbc() -> None:
    """Extended identifier, little-endian, two sensors in one frame, no header, no node service."""
    calibration = "surface,raw,deg\nright_flap,0,0\nright_flap,4000,40\n"
    rig = Rig(dbc=OWN, calibration=calibration)
    assert rig.take(rig.nodes.encode(deflection("left_flap", 1000, 12.5))) == []  # the frame waits for the other one
    left, right = rig.take(rig.nodes.encode(deflection("right_flap", 2000)))
    assert isinstance(left, SurfaceDeflection)
    assert isinstance(right, SurfaceDeflection)
    by_surface = {m.surface: m for m in (left, right)}
    assert by_surface["left_flap"].deflection == pytest.approx(math.radians(12.5))
    assert by_surface["left_flap"].raw == 1000
    assert by_surface["right_flap"].deflection == pytest.approx(math.radians(20.0))
    assert pickups.on_connect(rig.options) == []
    assert pickups.poll(rig.options) is None
    with pytest.raises(ValueError, match="the DBC has no message node_service_request"):
        pickups.command("read_table", {"surface": "left_flap"}, rig.options)


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"dbc": "garbage"}, "dbc: Invalid syntax at line 1"),
        ({"dbc": OWN.replace("_raw", "_r").replace("_deflection", "_d")}, "dbc: no signal is named <surface>_raw or"),
        ({"dbc": OWN.replace('"deg"', '"%"')}, "dbc: signal 'left_flap_deflection': unit '%'; allowed here: deg, rad"),
        ({"nodes": ("nose",)}, "nodes: 'nose' has no deflection in the DBC; allowed: flaps, left_wing"),
        ({"calibration": "surface,raw,deg\nnose,1,2\n"}, "calibration: line 2: surface 'nose'; there are elevator"),
    ],
)
def test_wrong_options_are_refused_in_a_sentence(keys: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=re.escape(sentence)):
        pickups.make_decoder(options(**keys))
