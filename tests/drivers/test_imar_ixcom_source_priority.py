"""iXCOM: source priority of messages with the same quantity; partial solutions; lost messages."""

from __future__ import annotations

import math
from typing import Any

import pytest

from fti.drivers import imar_ixcom as ix
from fti.drivers.imar_ixcom.decoder import PREFERRED
from fti.drivers.imar_ixcom.messages import TABLE
from fti.drivers.imar_ixcom.options import NUMBERS
from fti.drivers.imar_ixcom.wire import encode_frame
from fti.messages.measurements import Attitude, ImuSample, Position, Reading, Velocity
from tests.drivers.ixcom_frames import GNSS, GOOD, INSSOL, decode, frame, only


def position_sources(*data: bytes, **options: Any) -> list[float | None]:
    return [m.lat for m in decode(*data, **options) if isinstance(m, Position)]


def test_a_better_source_silences_the_others_for_five_seconds() -> None:
    ins, gnss = frame("INSSOL", **INSSOL | {"lat": 0.5}), frame("GNSSSOL", **GNSS | {"lat": 0.75})
    assert position_sources(gnss, ins, gnss, ins, gnss) == [0.75, 0.5, 0.5]
    decoder = ix.make_decoder(ix.Options())
    decoder.feed(ins, 0)
    for at_s, received in ((5, False), (6, True)):
        assert any(isinstance(m, Position) for m in decoder.feed(gnss, at_s * 10**9)) is received


def positions_over_time(*reported: tuple[float, bytes]) -> list[tuple[float | None, bool]]:
    """Latitude and validity of the positions of frames that come at these times [s]."""
    decoder = ix.make_decoder(ix.Options())
    measurements = [m for at_s, data in reported for m in decoder.feed(data, round(at_s * 1e9))]
    return [(m.lat, m.valid) for m in measurements if isinstance(m, Position)]


POSITION_UNDEFINED = GOOD | 0xC000
INS, LOST_INS = frame("INSSOL", **INSSOL | {"lat": 0.5}), frame("INSSOL", **INSSOL, footer=POSITION_UNDEFINED)
RECEIVER, LOST_RECEIVER = (frame("GNSSSOL", **GNSS | {"lat": 0.75, "solStatus": solved}) for solved in (0, 1))


def test_a_better_source_that_is_not_valid_does_not_hide_a_valid_one_for_ever() -> None:
    reported = [(0, INS), *((at, data) for at in range(1, 8) for data in (LOST_INS, RECEIVER)), (8, INS), (8, RECEIVER)]
    assert positions_over_time(*reported) == [
        (0.5, True), *[(0.84, False)] * 6, (0.75, True), (0.75, True), (0.5, True)
    ]  # fmt: skip


def test_before_the_better_source_was_ever_valid_the_other_counts_at_once() -> None:
    reported = [(0, LOST_INS), (0.1, RECEIVER), (0.2, LOST_INS), (0.3, RECEIVER), (0.4, INS), (0.5, RECEIVER)]
    assert positions_over_time(*reported) == [(0.84, False), (0.75, True), (0.75, True), (0.5, True)]


def test_while_no_source_is_valid_the_last_one_says_so_alone() -> None:
    reported = [(0, INS), (1, LOST_RECEIVER), (2, LOST_INS), (6.9, LOST_RECEIVER), (7, LOST_INS), (12.1, LOST_RECEIVER)]
    assert positions_over_time(*reported) == [(0.5, True), (0.84, False), (0.84, False), (0.75, False)]


def test_what_gives_way_is_kept_under_its_own_name() -> None:
    ins, gnss = frame("INSSOL", **INSSOL), frame("GNSSSOL", **GNSS | {"lat": 0.75, "stdDevPos": [1.0, 2.0, 3.0]})
    measurements = decode(ins, gnss, frame("IMURAW", acc=[0.0, 0.5, -9.75]))
    text = {m.name: (m.value, m.unit, m.valid) for m in measurements if isinstance(m, Reading)}
    assert text["gnsssol_lat"] == (0.75, "rad", True)
    assert text["gnsssol_alt_msl"] == (452.75, "m", True)
    assert text["gnsssol_horizontal_sd"] == (2.0, "m", True)
    assert text["gnsssol_down"] == (3.0, "m/s", True)
    assert text["imuraw_accel_b_y"] == (0.5, "m/s^2", True)
    assert len([m for m in measurements if isinstance(m, Position | Velocity | ImuSample)]) == 3
    invalid = decode(ins, frame("GNSSSOL", **GNSS | {"solStatus": 1}))
    assert {m.valid for m in invalid if isinstance(m, Reading) and m.name.startswith("gnsssol_")} == {False}


def test_parts_of_the_solution_come_beside_it() -> None:
    measurements = decode(
        frame("INSSOL", **INSSOL), frame("INSRPY", rpy=[0.25, 0.0, 0.0]), frame("INSVELNED", vel=[1.0] * 3)
    )
    assert [m.roll for m in measurements if isinstance(m, Attitude)][1:] == [0.25]
    assert [m.north for m in measurements if isinstance(m, Velocity)][1:] == [1.0]


def test_inertial_data_corrected_at_the_full_rate_go_first() -> None:
    data = {name: {"acc": [float(i), 0.0, -9.75]} for i, name in enumerate(("IMURAW", "INSSOL", "IMUCORR"))}
    raw, ins, corrected = (frame(name, **(INSSOL if name == "INSSOL" else {}) | acc) for name, acc in data.items())
    measurements = decode(raw, ins, raw, corrected, ins, raw, corrected)
    assert [m.accel_b[0] for m in measurements if isinstance(m, ImuSample) and m.accel_b] == [0.0, 1.0, 2.0, 2.0]


def test_a_second_device_on_the_line_takes_what_the_first_leaves() -> None:
    ins, gnss = frame("INSSOL", **INSSOL | {"lat": 0.5}), frame("GNSSSOL", **GNSS | {"lat": 0.75})
    assert position_sources(ins, gnss, ins, gnss, only=("GNSSSOL",)) == [0.75, 0.75]
    assert ix.make_encoder(ix.Options(only=("GNSSSOL",))).respond(ix.command("align", {})) == []


def test_parts_of_the_solution_stand_in_for_it() -> None:
    parts = [
        frame("INSRPY", rpy=[0.25, 0.0, -1.0]), frame("INSVELENU", vel=[-10.0, 60.0, -3.0]),
        frame("INSPOSLLH", lon=0.2, lat=0.84, alt=500.0),
    ]  # fmt: skip
    measurements = decode(*parts)
    assert only(Attitude, measurements).heading == pytest.approx(2 * math.pi - 1.0)
    velocity, position = only(Velocity, measurements), only(Position, measurements)
    assert (velocity.north, velocity.east, velocity.down) == (60.0, -10.0, 3.0)
    assert (position.lat, position.lon, position.alt) == (0.84, 0.2, 500.0)
    speed = only(Velocity, decode(frame("INSGNDSPEED", SOG=60.0, COG=-0.5, VDown=3.0)))
    assert (speed.ground_speed, speed.down, speed.north) == (60.0, 3.0, None)
    assert speed.track == pytest.approx(2 * math.pi - 0.5)


@pytest.mark.parametrize(
    ("name", "content"),
    [("INSVELENU", {"vel": [-10.0, 60.0, -3.0]}), ("INSGNDSPEED", {"SOG": 60.0, "COG": 5.5, "VDown": 3.0})],
)
def test_a_velocity_is_encoded_to_the_bytes_it_came_from(name: str, content: dict[str, Any]) -> None:
    """The other messages stand in the vectors; these two carry a Velocity as INSVELNED does."""
    data = frame(name, **content)
    encoder = ix.make_encoder(ix.Options(logs={name: 1}))
    assert [again for m in decode(data) for again in encoder.encode(m)] == [data]


def test_the_order_names_only_messages_that_are_understood() -> None:
    named = {name for lines in PREFERRED.values() for names in lines for name in names}
    assert named <= {message.name for message in TABLE}


def test_lost_messages_are_counted_by_the_counter_of_each_message() -> None:
    decoder = ix.make_decoder(ix.Options())
    for name, counter in (("IMURAW", 254), ("INSRPY", 7), ("IMURAW", 2), ("INSRPY", 8), ("INSRPY", 0)):
        payload = bytes(24 if name == "IMURAW" else 12)
        decoder.feed(encode_frame(NUMBERS[name], counter, 0, GOOD, payload), 1)
    assert decoder.counters.lost == {"IMURAW": 3}
