"""Comparison of the methods of position from the ground: its numbers from fixes that are written here."""

from __future__ import annotations

import json
import math
from dataclasses import replace as changed

import numpy as np
import pytest
from msgspec import structs

from fti import config as configuration
from fti.errors import ConfigError
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.messages.outputs import TerrainFix
from fti.messages.reasons import Reason
from fti.nav.filter.error_states import FilterModel
from fti.nav.filter.estimate import Estimate
from fti.nav.terrain_matching.fix import MatchFix, disagrees
from fti.post.score.truth_table import TruthTable
from fti.post.terrain_comparison.observer import (
    ALONE,
    BOUND,
    ComparedFlight,
    FilterSample,
    MethodComparison,
    MethodFix,
    bound_cov,
    offset_m,
)
from fti.post.terrain_comparison.reference import ReferencePosition, TruthReference
from fti.post.terrain_comparison.report import as_json, as_text
from fti.post.terrain_comparison.statistics import method_row, summarise
from fti.study.ground_flights import relief
from tests.helpers import ROOT
from tests.nav.test_terrain_methods import SEQUENTIAL, SHIFT, task

MAP_SD_M = 3.0
EXACT = np.zeros((2, 2))


def fix(north_m: float, east_m: float, sd_m: float = 4.0, *reasons: Reason, seconds: float = 0.1) -> MethodFix:
    """A fix with this error; with the map its sigma is hypot(sd, 3) for each axis."""
    output = TerrainFix(
        t_ns=2, t_valid_ns=1, valid=not reasons, reasons=reasons, lat=0.8, lon=0.1, north_sd=sd_m, east_sd=sd_m,
        correlation=0.0,
    )  # fmt: skip
    return MethodFix(output, seconds, np.array([north_m, east_m]), EXACT)


def test_a_row_of_the_table() -> None:
    # sigma 5 m for each axis: 5 m are 1, 10 m are 2, 40 m are 8 sigma
    fixes = [
        fix(3.0, 4.0, seconds=0.1),
        fix(-6.0, 8.0, seconds=0.2),
        fix(0.0, 40.0, seconds=0.9),
        fix(500.0, 0.0, 4.0, Reason.AMBIGUOUS),
        fix(0.0, 0.0, 4.0, Reason.GROUND_FLAT, Reason.AMBIGUOUS),
        fix(0.0, 0.0, 4.0, Reason.AMBIGUOUS),
    ]
    unknown = changed(fix(0.0, 0.0), error=None, reference_cov=None)
    bounds = [2.5, 5.0, math.nan, 1.0, 1.0, 1.0, 1.0]
    filtered = [FilterSample(np.array([3.0, 4.0]), 9.0), FilterSample(np.array([0.0, 0.0]), 9.0)]
    row = method_row("profile", [*fixes, unknown], bounds, filtered, MAP_SD_M)
    assert (row.profiles, row.valid, row.compared) == (7, 4, 3)
    assert row.refused == {"ambiguous": 2, "ground_flat": 1}
    assert row.median_m == pytest.approx(10.0)
    assert row.p95_m == pytest.approx(10.0 + 0.9 * 30.0)
    assert row.sd_m == pytest.approx(5.0 * math.sqrt(2.0))
    assert row.error_over_sd == pytest.approx(math.sqrt((1.0 + 4.0 + 64.0) / 3.0 / 2.0))
    assert row.inside == pytest.approx(2.0 / 3.0)  # 2.45 sigma of two dimensions contain 95 %
    assert row.wrong == 1
    # errors of 5 m and 10 m; bounds with the map, 18 m^2
    assert row.error_over_bound == pytest.approx(math.sqrt(0.5 * (25.0 / (6.25 + 18.0) + 100.0 / (25.0 + 18.0))))
    assert row.cpu_s == pytest.approx(0.1)
    assert row.filter_m == pytest.approx(math.sqrt(12.5))


def test_the_sigma_of_the_reference_counts() -> None:
    exact, uncertain = fix(10.0, 0.0), changed(fix(10.0, 0.0), reference_cov=75.0 * np.eye(2))
    rows = [method_row("profile", [each], [1.0], [], MAP_SD_M) for each in (exact, uncertain)]
    assert [row.error_over_sd for row in rows] == pytest.approx([math.sqrt(2.0), math.sqrt(0.5)])
    assert [row.error_over_bound for row in rows] == pytest.approx([10.0 / math.sqrt(19.0), 10.0 / math.sqrt(169.0)])
    assert rows[0].sd_m == rows[1].sd_m


def test_an_error_is_wrong_beyond_its_ellipse_and_30_m() -> None:
    wrong = [
        method_row("profile", [fix(error, 0.0, sd)], [1.0], [], 0.0).wrong
        for error, sd in ((29.0, 1.0), (31.0, 1.0), (31.0, 10.0), (38.0, 10.0))
    ]
    assert wrong == [0, 1, 0, 1]


def test_an_error_is_compared_with_the_sigma_of_its_axis() -> None:
    elongated = structs.replace(fix(0.0, 0.0).fix, north_sd=1.0, east_sd=50.0)
    along, across = (
        method_row("profile", [changed(fix(*error), fix=elongated)], [1.0], [], 0.0)
        for error in ((0.0, 50.0), (50.0, 0.0))
    )
    assert along.error_over_sd == pytest.approx(math.sqrt(0.5))
    assert (along.wrong, across.wrong) == (0, 1)
    # with a correlation of 0.8 the long axis of the ellipse is towards the north-east
    inclined = structs.replace(elongated, north_sd=50.0, correlation=0.8)
    north_east, north_west = (
        method_row("profile", [changed(fix(*error), fix=inclined)], [1.0], [], 0.0).error_over_sd
        for error in ((60.0, 60.0), (60.0, -60.0))
    )
    assert north_west == pytest.approx(3.0 * north_east)


def flight() -> ComparedFlight:
    """Two profiles of two methods; the second method has no fix."""
    refused = changed(fix(0.0, 0.0, 4.0, Reason.AMBIGUOUS), error=None)
    here = ReferencePosition(0.8, 0.1, EXACT)
    samples = {ALONE: [30.0, 40.0], BOUND: [0.0, 0.0], "profile": [5.0, 5.0], "printed": [7.0, 7.0]}
    return ComparedFlight(
        "ground truth of the emulator",
        MAP_SD_M,
        "profile",
        fixes={"profile": [fix(3.0, 4.0), fix(6.0, 8.0)], "printed": [refused, refused]},
        bounds=[3.0, math.nan],
        track=[(0, here), (1_000_000_000, here)],
        outage_ns=[0, 1_000_000_000],
        filters={
            name: [FilterSample(np.array([0.0, error]), 4.0) for error in errors] for name, errors in samples.items()
        },
    )


def test_the_report_has_a_line_with_inertial_filter_and_bound() -> None:
    result = summarise(flight())
    assert (result.alone_m, result.bound_m, result.profile_bound_m) == pytest.approx((math.sqrt(1250.0), 4.0, 3.0))
    lines = as_text(result)
    assert lines[0] == "reference: ground truth of the emulator"
    assert lines[-1] == (
        "inertial alone / filter (profile) / bound: 35.4 m / 5.0 m / 4.0 m, RMS over 2 s without satellites"
    )
    (row,) = (line for line in lines if line.startswith("printed"))
    assert row.split() == ["printed", "2", "0", "-", "-", "-", "-", "-", "0", "-", "0.1", "7", "2", "ambiguous"]


def test_json_has_every_fix_and_no_nan() -> None:
    found = flight()
    table = json.loads(json.dumps(as_json(summarise(found), found), allow_nan=False))
    assert table["bounds_m"] == [3.0, None]
    assert table["methods"][1]["median_m"] is None
    assert [each["error_east"] for each in table["methods"][0]["fixes"]] == [4.0, 8.0]


# ---------------------------------------------------------------------------------------------------------- observer


def test_the_bound_is_that_of_the_slopes_below_the_true_track() -> None:
    ground = relief("hills", 0)
    given = task("laser", ground, ground)
    middle = given.heights.samples.origins.mean(axis=0)  # the middle of the profile, as the samples are
    lat, lon, alt = map(float, ground.frame.to_geodetic(middle))
    y = np.concatenate((ecef_from_geodetic(lat, lon, alt), np.zeros(3), [1.0, 0.0, 0.0, 0.0], np.zeros(6)))
    marked = Estimate(0, y, np.eye(15), np.zeros(6), FilterModel())
    true_lat, true_lon, _ = map(float, ground.frame.to_geodetic(middle + np.append(SHIFT, 0.0)))
    cov = bound_cov(
        changed(given, priors=changed(given.priors, drift_sd=0.0)), marked, ReferencePosition(true_lat, true_lon, EXACT)
    )
    of = given.heights.samples
    east, north, _ = (of.origins + of.ranges[:, None] * of.axes + np.append(SHIFT, 0.0)).T
    rows = np.column_stack((*ground.gradient(east, north), np.ones_like(east))) / of.sds[:, None]
    information = rows.T @ rows + np.diag([0.0, 0.0, given.height_sd**-2])
    assert cov is not None
    np.testing.assert_allclose(cov, np.linalg.inv(information)[:2, :2] / given.priors.independent_share, rtol=1e-3)


def test_a_fix_disagrees_beyond_99_9_percent_of_both_sigmas() -> None:
    ground = relief("hills", 0)
    free = task("laser", ground, ground)
    given = changed(free, priors=changed(free.priors, position_cov=9.0 * np.eye(2)))
    found = [
        MatchFix(0.0, np.array([shift, 0.0]), 16.0 * np.eye(2), 0.0, 1.0, np.zeros(2), 0.0, 1.0, frozenset())
        for shift in (18.4, 18.8)  # 3.71 sigma of 5 m are 18.57 m
    ]
    far = [disagrees(each.shift, each.cov, given.limits, given.priors.position_cov) for each in found]
    assert far == [False, True]
    assert not disagrees(found[1].shift, found[1].cov, free.limits, free.priors.position_cov)


def test_the_error_is_north_and_east_of_the_reference() -> None:
    error = offset_m(0.8 + 1e-6, 0.1 + 1e-6, 0.0, ReferencePosition(0.8, 0.1, EXACT))
    moved = ecef_from_geodetic(0.8 + 1e-6, 0.1 + 1e-6, 0.0) - np.array(ecef_from_geodetic(0.8, 0.1, 0.0))
    assert np.hypot(*error) == pytest.approx(np.linalg.norm(moved), rel=1e-5)
    assert error[0] > error[1] > 0.0


def test_the_truth_is_interpolated_within_its_flights() -> None:
    columns = {"lat": np.array([0.8, 0.9]), "lon": np.array([0.1, 0.3])}
    reference = TruthReference([TruthTable(np.array([0, 40_000_000]), columns)])
    at = reference.at(10_000_000)
    assert at is not None
    assert (at.lat, at.lon) == pytest.approx((0.825, 0.15))
    assert reference.at(40_000_001) is None


def test_a_configuration_without_the_table_is_refused() -> None:
    demo = ROOT / "configs" / "demo.toml"
    with pytest.raises(ConfigError, match=r"demo\.toml: has no \[nav\.terrain_position\]"):
        MethodComparison(configuration.load(demo), demo, [])


@pytest.mark.parametrize(
    ("name", "in_flight", "others"),
    [
        ("terrain_position", "profile", {"five_point", "printed", "vertical", "closed_loop", *SEQUENTIAL}),
        ("terrain_position_beams", "beams", {"profile", "five_point", "printed", *SEQUENTIAL}),
    ],
)
def test_every_method_that_applies_is_compared(name: str, in_flight: str, others: set[str]) -> None:
    file = ROOT / "configs" / f"{name}.toml"
    found = MethodComparison(configuration.load(file), file, []).flight
    assert found.in_flight == in_flight
    assert set(found.fixes) == {in_flight, *others}
    assert set(found.filters) == {ALONE, BOUND, in_flight, *others}
