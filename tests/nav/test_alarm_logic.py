"""The alarm logic as a table: a row is a sequence of updates and the states that must follow."""

import math
from collections.abc import Iterable

import pytest

from fti.messages.outputs import IntegrityState
from fti.messages.reasons import Reason
from fti.nav.integrity.alarm_logic import AlarmLogic, Ratios

GOOD = Ratios(0.5, 0.5, 0.5, 0.5)
T1 = Ratios(1.1, 0.5, 0.5, 0.5)
T2 = Ratios(0.5, 1.1, 0.5, 0.5)
T3 = Ratios(0.5, 0.5, 1.1, 0.5)
T4 = Ratios(0.5, 0.5, 0.5, 1.1)
WARM = Ratios(0.9, 0.5, 0.5, 0.5)
BLIND = Ratios(0.5, None, 0.5, 0.5)
NO_NUMBER = Ratios(math.nan, 0.5, 0.5, 0.5)
BLIND_T1 = Ratios(1.1, None, 0.5, 0.5)

#: The window is as long as the way of three updates.
WINDOW_M, STEP_M = 40.0, 20.0

TABLE = {
    "nominal": ([GOOD] * 3, "ok ok ok"),
    "T2 once is a caution, remembered for three updates": ([T2, GOOD, GOOD, GOOD], "caution caution caution ok"),
    "T3 once is a caution": ([T3, GOOD, GOOD, GOOD], "caution caution caution ok"),
    "T1 once is nothing": ([T1, GOOD, GOOD], "ok ok ok"),
    "T4 once is nothing": ([T4, GOOD, T4, GOOD], "ok ok ok ok"),
    "T4 twice in a row": ([T4, T4], "ok alert"),
    "T1 in two of three": ([T1, GOOD, T1], "ok ok alert"),
    "T2 in two of three": ([T2, T2], "caution alert"),
    "T3 in two of three": ([T3, GOOD, T3], "caution caution alert"),
    "T1 in two of four is nothing": ([T1, GOOD, GOOD, T1], "ok ok ok ok"),
    "different tests do not add up": ([T1, T2, T3], "ok caution caution"),
    "a calm window ends an alert": ([T1, T1, GOOD, GOOD, GOOD], "ok alert alert alert ok"),
    "above 0.8 is not calm": ([T1, T1, GOOD, GOOD, WARM, GOOD, GOOD, GOOD], "ok" + " alert" * 6 + " ok"),
    "what is no number keeps no limit": ([NO_NUMBER, NO_NUMBER], "ok alert"),
    "what is no number is not calm": ([T1, T1, GOOD, GOOD, NO_NUMBER, GOOD], "ok" + " alert" * 5),
    "not observable is monitor": ([BLIND, GOOD], "monitor ok"),
    "monitor alerts too": ([BLIND_T1, BLIND_T1], "monitor alert"),
    "a shift that is no longer seen has not gone": (
        [T2, T2] + [BLIND] * 5 + [GOOD] * 3,
        "caution" + " alert" * 8 + " ok",
    ),
    "another alert may end unobserved": ([T1, T1, BLIND, BLIND, BLIND], "ok alert alert alert monitor"),
}


def states(logic: AlarmLogic, updates: Iterable[Ratios], begin: float = 3000.0) -> list[IntegrityState]:
    return [logic.step(ratios, begin - STEP_M * k)[0] for k, ratios in enumerate(updates)]


@pytest.mark.parametrize("name", TABLE)
def test_table(name: str) -> None:
    updates, expected = TABLE[name]
    assert " ".join(states(AlarmLogic(WINDOW_M), updates)) == expected


@pytest.mark.parametrize("over", [T1, T2, T3, T4])
def test_an_alert_of_any_test_lasts_until_a_whole_new_window_was_calm(over: Ratios) -> None:
    """400 m behind the first calm update, 20 updates of 20 m later."""
    results = states(AlarmLogic(400.0), [over] * 2 + [GOOD] * 21)
    assert results[1:] == [IntegrityState.ALERT] * 21 + [IntegrityState.OK]


@pytest.mark.parametrize("disturbed", [WARM, T1, T4, NO_NUMBER])
def test_what_is_not_calm_begins_the_window_again(disturbed: Ratios) -> None:
    results = states(AlarmLogic(400.0), [T1] * 2 + [GOOD] * 19 + [disturbed] + [GOOD] * 21)
    assert results[1:] == [IntegrityState.ALERT] * 41 + [IntegrityState.OK]


def test_an_update_that_was_not_evaluated_restarts_the_window() -> None:
    """Calm, 600 m without a result, calm: the interval between is unknown."""
    logic = AlarmLogic(400.0)
    states(logic, [T1, T1, GOOD], 3000.0)
    logic.skip()
    assert states(logic, [GOOD] * 21, 2360.0) == [IntegrityState.ALERT] * 20 + [IntegrityState.OK]


def test_an_alert_names_its_causes_until_it_ends() -> None:
    logic = AlarmLogic(WINDOW_M)
    for ratios in (T4, T4, T1, T1):
        _, reasons = logic.step(ratios, 3000.0)
    assert reasons == (Reason.ABSOLUTE_MATCH, Reason.OBSTACLE)
    assert logic.step(BLIND, 3000.0)[1][-1] is Reason.NOT_OBSERVABLE
