"""The score detects every falsification of a session, and holds every honest one.

``--scale quick`` applies each falsification to the first of three flights that has something to falsify so, and to all
flags of one of them; ``--scale full`` applies all of them to every shipped scenario, flown to its end.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from fti.hil import scenario as scenarios
from tests.post.score.sabotage.campaign import Outcome, Sum, run
from tests.post.score.sabotage.catalogue import CATALOGUE, GROUPS
from tests.post.score.sabotage.falsification import Falsification, Sample
from tests.post.score.sabotage.flights import shipped_sample, short_sample

pytestmark = pytest.mark.timeout(3600)
SHORT = "short"
#: A short flight with six faults, and parts of shipped ones [s].
FLIGHTS: dict[str, float | None] = {SHORT: None, "obstacle": 46.0, "fallbacks": 50.0}
#: Every flag of this one is falsified.
ALL_FLAGS = "obstacle"


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """At full scale each flight is a test of its own."""
    if "names" in metafunc.fixturenames:
        is_full = metafunc.config.getoption("--scale") == "full"
        alone = [(name,) for name in (SHORT, *scenarios.shipped_names())]
        metafunc.parametrize("names", alone if is_full else [tuple(FLIGHTS)], ids="-".join)


def _sample(name: str, folder: Path, until_s: float | None, *, others: bool) -> Sample:
    """A flight whose honest session holds."""
    sample = short_sample(folder) if name == SHORT else shipped_sample(name, folder, until_s, others=others)
    assert sample.honest.holds, sample.honest.failures
    return sample


def _attack(sample: Sample, chosen: Sequence[Falsification], folder: Path, *, every: bool, turn: int = 0) -> Sum:
    """Apply falsifications; each that changes something must be detected."""
    total = Sum(list(run(sample, chosen, folder, every=every, turn=turn)))
    print("\n".join(total.lines()))
    assert not total.undetected, "\n".join(f"{one.falsification}: {one.target}" for one in total.undetected)
    return total


def test_the_score_detects_every_falsification(names: tuple[str, ...], scale: int, tmp_path: Path) -> None:
    is_full, left = scale > 1, dict(CATALOGUE)
    for name in names:
        sample = _sample(name, tmp_path, None if is_full else FLIGHTS[name], others=is_full)
        turn = scenarios.shipped_names().index(name) if name != SHORT else 0
        total = _attack(sample, list(left.values()), tmp_path, every=is_full and name == SHORT, turn=turn)
        left = {one: falsification for one, falsification in left.items() if one not in total.applied()}
        if name == ALL_FLAGS and not is_full:
            _attack(sample, GROUPS["flags"], tmp_path, every=True)
    assert is_full or not left, "no flight has anything to falsify so"


def test_there_are_more_than_forty_ways_and_each_has_a_reason_and_a_name_of_its_own() -> None:
    listed = [one for group in GROUPS.values() for one in group]
    assert len(CATALOGUE) == len(listed) > 40
    assert all(one.why for one in listed)


def test_the_sum_names_what_was_not_detected() -> None:
    outcomes = [
        Outcome("nominal", "delete output", "/nav/x", True, "rows: x: missing"),
        Outcome("nominal", "sigma zero", "/nav/x sd", False, ""),
        Outcome("nominal", "flag never clears", "", None, "nothing there"),
    ]
    total = Sum(outcomes)
    assert total.undetected == [outcomes[1]]
    assert list(total.lines())[-1] == "2 of 3 falsifications applied 2 times: 1 detected, 1 not detected"
