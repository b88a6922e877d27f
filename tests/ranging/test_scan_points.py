"""Points of a scan: arrays to a message and back, its summary, and what a record has of it."""

from __future__ import annotations

import json
import math
import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from fti.logger.encoding import encode
from fti.logger.export.point_rows import POINT_COLUMNS, point_rows
from fti.logger.schemas import json_schema
from fti.messages.measurements import PointArrays, RangeScan, Stamp
from fti.messages.tables import without_arrays
from fti.messages.topic_fields import fields
from fti.ranging.scan_points import change_ranges, make_scan, point_arrays, replace_far_ranges, scan_points

DOWN = np.array([[0.0, 0.6, 0.8], [0.0, 0.0, 1.0], [0.0, -0.6, 0.8]])
OFFSETS = np.array([0.0, 0.001, 0.002])
STAMP = Stamp(5_000, t_valid_ns=4_000)


def scan(*ranges: float, valid: bool = True, stamp: Stamp = STAMP) -> RangeScan:
    arrays = point_arrays(DOWN, OFFSETS, [0, 128, 255])
    return make_scan(stamp, ranges, arrays, valid)


def test_points_come_back_with_their_own_times() -> None:
    points = scan_points(scan(10.0, math.nan, 12.5))
    assert points.times_ns.tolist() == [4_000, 1_004_000, 2_004_000] and points.times_ns.dtype == np.int64
    np.testing.assert_array_equal(points.ranges, np.array([10.0, math.nan, 12.5]))
    np.testing.assert_allclose(points.directions_s, DOWN, atol=1e-7)
    assert points.intensities is not None and points.intensities.tolist() == [0, 128, 255]


def test_without_a_time_of_validity_the_points_begin_at_the_arrival() -> None:
    assert scan_points(scan(1.0, 2.0, 3.0, stamp=Stamp(5_000))).times_ns[0] == 5_000


@given(st.lists(st.floats(0.0, 1000.0, width=32) | st.just(math.nan), max_size=30))
def test_the_summary_is_that_of_the_ranges_that_are_there(ranges: list[float]) -> None:
    found = make_scan(Stamp(0), ranges, PointArrays())
    known = [value for value in ranges if not math.isnan(value)]
    assert (found.points, found.returns) == (len(ranges), len(known))
    assert found.nearest == (min(known) if known else None)
    assert found.median == (statistics.median_low(known) if known else None)


def test_a_scan_that_is_not_valid_has_no_range() -> None:
    invalid = scan(1.0, 2.0, 3.0, valid=False)
    assert (invalid.points, invalid.returns, invalid.nearest, invalid.median) == (3, 0, None, None)
    assert np.isnan(scan_points(invalid).ranges).all()


def test_a_record_has_the_summary_and_no_array() -> None:
    measured = scan(10.0, math.nan, 12.5)
    table = json.loads(encode(measured))
    assert {name: table[name] for name in table if name != "stamp"} == {
        "points": 3, "returns": 2, "nearest": 10.0, "median": 10.0, "valid": True,
    }  # fmt: skip
    assert list(json_schema(RangeScan)["properties"]) == list(table)
    assert {field.name.partition(".")[0] for field in fields(RangeScan)} == set(table)
    assert without_arrays(measured) == replace(measured, arrays=PointArrays())
    assert encode(without_arrays(measured)) == encode(measured)


def test_scans_with_the_same_points_are_equal() -> None:
    assert scan(1.0, math.nan, 3.0) == scan(1.0, math.nan, 3.0) != scan(1.0, math.nan, 3.5)


def test_each_point_has_a_row() -> None:
    rows = list(point_rows(scan(10.0, math.nan, 12.5)))
    assert [t_ns for t_ns, _ in rows] == [4_000, 1_004_000, 2_004_000]
    assert [cells[0] for _, cells in rows] == [10.0, None, 12.5] and [cells[4] for _, cells in rows] == [0, 128, 255]
    assert rows[0][1][1:4] == pytest.approx([0.0, 0.6, 0.8]) and len(rows[0][1]) == len(POINT_COLUMNS)


def test_a_change_of_the_ranges_leaves_missing_ones_missing() -> None:
    changed = change_ranges(scan(10.0, math.nan, 12.5), lambda value: 2.0 * value)
    np.testing.assert_array_equal(scan_points(changed).ranges, np.array([20.0, math.nan, 25.0]))
    assert (changed.nearest, changed.returns, changed.arrays.offsets) == (20.0, 2, scan(0, 0, 0).arrays.offsets)


@pytest.mark.parametrize(("echo", "expected"), [(None, [10.0, math.nan, math.nan]), (4.0, [10.0, 4.0, 4.0])])
def test_ranges_beyond_a_limit_are_lost_or_those_of_an_echo(echo: float | None, expected: list[float]) -> None:
    changed = replace_far_ranges(scan(10.0, math.nan, 12.5), 11.0, echo)
    np.testing.assert_array_equal(scan_points(changed).ranges, np.array(expected))


def test_arrays_of_different_lengths_are_refused() -> None:
    torn = replace(scan(1.0, 2.0, 3.0), points=4)
    with pytest.raises(ValueError, match=r"a scan of 4 points have \[3, 4\] points"):
        scan_points(torn)
