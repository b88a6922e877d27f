"""Targets of the study ``strapdown``."""

from __future__ import annotations

from fti.arrays import Array
from fti.study import StudyResult
from fti.study.strapdown.experiment import FORMS, StrapdownRun
from fti.study.trajectory.experiment import STEP_S, Closure
from fti.study.trajectory.judge import judge_closures, judge_halving

#: Targets of the fast form on a calm track [m].
CALM_M, CALM_VERTICAL_M = 0.1, 1.0


def judge_all(runs: list[StrapdownRun]) -> list[StudyResult]:
    """T12 of both forms."""
    return [
        *judge_closures([run.high for run in runs]),
        *judge_live([run.calm for run in runs], [run.lively for run in runs]),
        *judge_turns([run.turns for run in runs]),
    ]


def judge_live(still: list[Closure], lively: list[Closure]) -> list[StudyResult]:
    """The fast form: greatest errors of all flights within the hour."""
    words = f"of the fast form at {1 / STEP_S:.0f} Hz, greatest of {len(still)} flights"
    position, height = f"error of the position {words}", f"error of the height {words}"
    return [
        StudyResult.at_most(
            "T12.calm_horizontal", f"{position}, a calm track [m]", max(c.horizontal for c in still), CALM_M
        ),
        StudyResult.at_most(
            "T12.calm_vertical", f"{height}, a calm track [m]", max(c.vertical for c in still), CALM_VERTICAL_M
        ),
        StudyResult.reported(
            "T12.lively_horizontal", f"{position}, lively flight [m]", max(c.horizontal for c in lively)
        ),
        StudyResult.reported("T12.lively_vertical", f"{height}, lively flight [m]", max(c.vertical for c in lively)),
    ]


def judge_turns(found: list[dict[str, Array]]) -> list[StudyResult]:
    """Minimum factor by which the error after S-turns falls when the step is halved, by form."""
    return [
        judge_halving(f"T12.turns_{form.replace(' ', '_')}", [errors[form] for errors in found], f", {form}")
        for form in FORMS
    ]
