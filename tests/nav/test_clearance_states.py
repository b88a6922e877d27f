"""The alarm logic as a table: a row is a sequence of updates and the states that must follow."""

import math

import pytest

from fti.nav.integrity.states import AlarmLogic, Ratios
from fti.types import IntegrityState, Reason

GOOD = Ratios(0.5, 0.5, 0.5, 0.5)
T1 = Ratios(1.1, 0.5, 0.5, 0.5)
T2 = Ratios(0.5, 1.1, 0.5, 0.5)
T3 = Ratios(0.5, 0.5, 1.1, 0.5)
T4 = Ratios(0.5, 0.5, 0.5, 1.1)
WARM = Ratios(0.9, 0.5, 0.5, 0.5)
BLIND = Ratios(0.5, None, 0.5, 0.5)
NO_NUMBER = Ratios(math.nan, 0.5, 0.5, 0.5)
BLIND_T1 = Ratios(1.1, None, 0.5, 0.5)

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
    "three calm updates end an alert": ([T1, T1, GOOD, GOOD, GOOD], "ok alert alert alert ok"),
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


@pytest.mark.parametrize("name", TABLE)
def test_table(name: str) -> None:
    updates, expected = TABLE[name]
    logic = AlarmLogic()
    assert " ".join(logic.step(ratios, True)[0] for ratios in updates) == expected


def test_alert_lasts_while_the_window_holds_the_obstacle() -> None:
    logic = AlarmLogic()
    states = [logic.step(T4, False)[0] for _ in range(2)] + [logic.step(GOOD, False)[0] for _ in range(10)]
    assert states[1:] == [IntegrityState.ALERT] * 11
    assert logic.step(GOOD, True)[0] is IntegrityState.OK


def test_an_alert_names_its_causes_until_it_ends() -> None:
    logic = AlarmLogic()
    for ratios in (T4, T4, T1, T1):
        _, reasons = logic.step(ratios, True)
    assert reasons == (Reason.ABSOLUTE_MATCH, Reason.OBSTACLE)
    assert logic.step(BLIND, True)[1][-1] is Reason.NOT_OBSERVABLE
