"""``fti export --resample``: the last valid sample that is not too old."""

from __future__ import annotations

import math
from typing import Any

import pytest

from fti.errors import RecordingError
from fti.logger.export.columns import Column, Type
from fti.logger.export.measurement_rows import MeasurementRows
from fti.logger.export.resampled import ResampledTable
from fti.messages.measurements import Attitude, Measurement, Range, Reading, Stamp
from fti.messages.topics import measurement_topic

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000


class Table:
    """A table with 10 rows in a second; values of the device "ins" are stale after 250 ms."""

    def __init__(self) -> None:
        self.grid = ResampledTable(10, {"ins": 250 * MS}, lambda topic: topic.strip("/").replace("/", "_"))
        self._rows: dict[str, MeasurementRows] = {}

    def add(self, t_ms: int, measurement: Measurement, late_ms: int = 5) -> None:
        """A measurement that was valid at t_ms."""
        topic = measurement_topic("ins", type(measurement))
        if topic not in self._rows:
            self._rows[topic] = MeasurementRows(topic, type(measurement))
            self.grid.open(topic, self._rows[topic].columns)
        t_ns = START_NS + t_ms * MS
        self.grid.write(topic, (t_ns + late_ms * MS, t_ns), self._rows[topic].cells(measurement))

    def columns(self, end_s: float = math.inf) -> dict[str, list[Any]]:
        """The columns by their heads."""
        rows = zip(*self.grid.rows(START_NS, 0.0, end_s), strict=True)
        return dict(zip([column.head for column in self.grid.columns], map(list, rows), strict=True))


STAMP = Stamp(0)


def test_a_row_has_the_last_sample_before_it() -> None:
    table = Table()
    for t_ms in range(0, 1001, 30):
        table.add(t_ms, Attitude(stamp=STAMP, heading=math.radians(t_ms % 360)))
    found = table.columns()
    assert found["t_s"] == pytest.approx([n / 10 for n in range(11)])
    assert found["utc"] == [START_NS + n * 100 * MS for n in range(11)]
    expected = [(n * 100 // 30 * 30) % 360 for n in range(11)]
    assert found["ins_attitude.heading [rad]"] == pytest.approx([math.radians(angle) for angle in expected])


def test_rows_are_at_whole_periods_of_utc() -> None:
    table = Table()
    for t_ms in (30, 130, 230):
        table.add(t_ms, Range(stamp=STAMP, slant_range=1.0))
    (row,) = table.grid.rows(START_NS + 30 * MS, 0.0, 0.15)
    assert row[:2] == (0.07, START_NS + 100 * MS)


def test_a_stale_value_is_unknown() -> None:
    table = Table()
    table.add(0, Range(stamp=STAMP, slant_range=5.0))
    table.add(800, Range(stamp=STAMP, slant_range=6.0))
    assert table.columns()["ins_range.slant_range [m]"] == [5.0, 5.0, 5.0, None, None, None, None, None, 6.0]


def test_an_invalid_value_is_unknown_and_its_validity_is_known() -> None:
    table = Table()
    table.add(0, Range(stamp=STAMP, slant_range=5.0))
    table.add(90, Range(stamp=STAMP, slant_range=7.0, valid=False))
    table.add(190, Range(stamp=STAMP, slant_range=None))
    found = table.columns()
    assert found["ins_range.slant_range [m]"] == [5.0, None, None]
    assert found["ins_range.valid"] == [True, False, True]


def test_a_message_with_a_part_leaves_the_others() -> None:
    table = Table()
    table.add(0, Attitude(stamp=STAMP, roll=0.1))
    table.add(50, Attitude(stamp=STAMP, pitch=0.2))
    table.add(150, Attitude(stamp=STAMP, roll=0.3, valid=False))
    table.add(250, Attitude(stamp=STAMP, valid=False))
    table.add(350, Attitude(stamp=STAMP, heading=1.0))
    found = table.columns()
    assert found["ins_attitude.roll [rad]"] == [0.1, 0.1, None, None, None]
    assert found["ins_attitude.pitch [rad]"] == [None, 0.2, 0.2, None, None]
    assert table.columns(end_s=0.1)["ins_attitude.pitch [rad]"] == [None, 0.2]


def test_samples_may_arrive_in_another_order_than_that_of_validity() -> None:
    table = Table()
    for t_ms in (550, 150, 450, 120, 250, 340, 310):
        table.add(t_ms, Range(stamp=STAMP, slant_range=float(t_ms)))
    assert table.columns()["ins_range.slant_range [m]"] == [None, None, 150.0, 250.0, 340.0, 450.0, 550.0]


def test_the_attitude_of_the_navigation_solution_has_a_validity_of_its_own() -> None:
    grid = ResampledTable(10, {}, lambda topic: "nav")
    names = {
        "valid": Type.BOOL,
        "attitude_valid": Type.BOOL,
        "lat": Type.FLOAT,
        "roll": Type.FLOAT,
        "refused": Type.TEXTS,
    }
    grid.open("/nav/nav_solution", [Column(name, kind) for name, kind in names.items()])
    for n, valid in enumerate(((True, True), (False, True), (True, False))):
        t_ns = START_NS + n * 100 * MS
        grid.write("/nav/nav_solution", (t_ns, t_ns), [*valid, 0.5, 0.1, ["gnss"]])
    rows = list(grid.rows(START_NS, 0.0, math.inf))
    assert [row[5:] for row in rows] == [(0.5, 0.1, ["gnss"]), (None, 0.1, ["gnss"]), (0.5, None, ["gnss"])]


def test_readings_are_columns_by_name_with_their_unit() -> None:
    table = Table()
    for name, value, unit in (("bus", 28.0, "V"), ("load", 3.0, "A")):
        table.add(0, Reading(stamp=STAMP, name=name, value=value, unit=unit))
    found = table.columns()
    assert found["ins_reading.bus.value [V]"] == [28.0] and found["ins_reading.load.value [A]"] == [3.0]


def test_events_are_in_the_row_after_them() -> None:
    table = Table()
    table.grid.open("/fti/event", [Column("level", Type.INT), Column("message", Type.TEXT)])
    for t_ms, text in ((20, "flare"), (100, "touch"), (110, "roll"), (900, "never")):
        table.grid.write("/fti/event", (0, START_NS + t_ms * MS), [2, text])
    table.add(0, Range(stamp=STAMP, slant_range=1.0))
    table.add(200, Range(stamp=STAMP, slant_range=1.0))
    assert table.columns()["events"] == [None, "flare; touch", "roll"]


def test_a_session_of_years_is_refused() -> None:
    table = Table()
    table.add(0, Range(stamp=STAMP, slant_range=1.0))
    table.add(10**11, Range(stamp=STAMP, slant_range=1.0))
    with pytest.raises(RecordingError, match=r"1000000000 rows, .* at most"):
        table.columns()
