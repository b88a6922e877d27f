"""The study of position from a radar's ranges: few fixes, a judge that can say no, and the exact forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fti.nav.five_point_search import five_point_search
from fti.study import ppsan
from fti.study.ppsan import experiment, judge
from fti.study.ppsan.exact import ExactLikelihood, FootprintMetric, search_grids, shifted_poses
from fti.study.ppsan.experiment import METHODS, FixRun, PositionError

SMALL, GOOD, POOR = PositionError(0.5, 0.1), PositionError(2.0, 0.4), PositionError(60.0, 9.0)
RUN = FixRun(inverted=SMALL, methods={**dict.fromkeys(METHODS[:3], POOR), "closed": GOOD}, coarse=POOR, elevation=GOOD)


def test_few_fixes_hold_what_does_not_need_many() -> None:
    shares: list[float] = []
    results = {result.id: result for result in ppsan.study(2, 15, shares.append)}
    assert shares[-1] == 1.0
    assert {name for name, result in results.items() if not result.holds} <= {"T15.inside.bound"}
    assert results["T15.inside"].value == 1.0


def test_the_judge_can_say_no() -> None:
    assert all(result.holds for result in judge.judge_fixes([RUN] * 100))

    def failed(run: FixRun, count: int) -> set[str]:
        return {result.id for result in judge.judge_fixes([RUN] * (100 - count) + [run] * count) if not result.holds}

    assert failed(replace(RUN, inverted=PositionError(0.9, 0.21)), 5) == set()
    assert failed(replace(RUN, inverted=PositionError(1.1, 0.1)), 6) == {"T15.inside", "T15.inside.bound"}
    assert failed(replace(RUN, methods={**RUN.methods, "closed": PositionError(3.1, 1.3)}), 60) == {
        "T15.beam.median",
        "T15.beam.vertical",
    }
    far = PositionError(8.1, 0.1)
    assert failed(replace(RUN, methods={**RUN.methods, "closed": far}), 10) == {"T15.beam.p95"}
    better = {**RUN.methods, "valid": PositionError(5.9, 9.0)}
    assert failed(replace(RUN, methods=better), 100) == {"T15.method2"}
    assert failed(replace(RUN, methods={**RUN.methods, "valid": None}), 100) == set()  # no fix: the corner of the grid


def test_the_bound_of_a_share_is_that_of_wilson() -> None:
    """Newcombe 1998, table I: 81 of 263 is 0.2553 to 0.3662, 15 of 148 is 0.0624 to 0.1605."""
    assert judge.wilson_bound(81 / 263, 263) == pytest.approx(0.2553, abs=5e-5)
    assert judge.wilson_bound(15 / 148, 148) == pytest.approx(0.0624, abs=5e-5)


def test_without_errors_the_exact_forms_vanish_at_the_true_shift() -> None:
    """Ranges of the model itself, without noise: there the chi-square is 0, and the literal metric its smallest.

    The literal metric is not 0: the strongest ray at an edge is not as long as the edge.
    """
    rng, ground = np.random.default_rng(5), experiment.make_ground(3)
    track = replace(experiment.draw_track(ground, rng), error=np.array([4.0, -2.0]), height_error=0.0)
    true = shifted_poses(track.poses, track.error)
    ranges = experiment.model().measure(ground, true).slant_range
    measured = replace(track.measure(ground, experiment.model(), rng), slant_range=ranges)
    measured = experiment.select(measured, np.isfinite(measured.slant_range))
    exact = ExactLikelihood(experiment.model(), ground, measured)
    shifts = np.array([track.error, [5.0, -2.0], [4.0, -3.0], [0.0, 0.0]])
    chi_square = exact.chi_square(shifts)
    assert chi_square[0] < 1e-12 and chi_square[1:].min() > 1.0
    assert exact.up(track.error) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(search_grids(exact.chi_square, np.zeros(2), [(2, 2.0)]), track.error)
    literal = FootprintMetric(experiment.model(), ground, measured)
    values = literal(shifts)
    assert values[0] == values.min() < 0.5 * values[3]
    assert np.hypot(*(five_point_search(literal, 20.0, 1.0)[0] - track.error)) < 3.0
