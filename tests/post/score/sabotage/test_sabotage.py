"""The score detects every falsification of a session, and holds every honest one.

``--scale quick`` attacks five flights, cut short; ``--scale full`` every shipped scenario, to its end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from fti.hil import scenario as scenarios
from tests.post.score.sabotage.campaign import Outcome, Sum, run
from tests.post.score.sabotage.catalogue import CATALOGUE, GROUPS
from tests.post.score.sabotage.falsification import Sample
from tests.post.score.sabotage.flights import shipped_sample, short_sample
from tests.post.score.sabotage.message_edits import Forgery

pytestmark = pytest.mark.timeout(3600)
SHORT = "short"


@dataclass(frozen=True)
class Attacked:
    """A flight that is attacked.  groups : of falsifications; every : each target of each, not one"""

    duration_s: float | None = None
    groups: Sequence[str] = tuple(GROUPS)
    every: bool = False


#: Flights of the quick tier: a short one with six faults, and parts of shipped ones [s].
QUICK = {
    SHORT: Attacked(),
    "nominal": Attacked(30.0, ("removals", "timing", "values", "labels", "configurations", "truths")),
    "fallbacks": Attacked(50.0, ("labels", "flags")),
    "gauntlet_slcan": Attacked(None, ("flags", "excuses", "configurations")),
    "gauntlet_udp": Attacked(None, ("flags",), every=True),
    "obstacle": Attacked(46.0, ("flags",), every=True),
}


def _sample(name: str, attacked: Attacked, folder: Path) -> Sample:
    if name == SHORT:
        return short_sample(folder)
    return shipped_sample(name, folder, attacked.duration_s, others="truths" in attacked.groups)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "name" in metafunc.fixturenames:
        full = {SHORT: Attacked(every=True), **{name: Attacked() for name in scenarios.shipped_names()}}
        flights = full if metafunc.config.getoption("--scale") == "full" else QUICK
        metafunc.parametrize(("name", "attacked"), flights.items(), ids=list(flights))


def test_the_score_detects_every_falsification(name: str, attacked: Attacked, tmp_path: Path) -> None:
    sample = _sample(name, attacked, tmp_path)
    assert sample.honest.holds, sample.honest.failures
    chosen = [one for group in attacked.groups for one in GROUPS[group]]
    turn = scenarios.shipped_names().index(name) if name != SHORT else 0
    found = Sum(list(run(sample, chosen, tmp_path, every=attacked.every, turn=turn)))
    print("\n".join(found.lines()))
    assert not found.undetected, "\n".join(f"{one.falsification}: {one.target}" for one in found.undetected)


def test_every_falsification_is_applied_to_a_session(tmp_path: Path) -> None:
    """What changes nothing in a session is skipped there: none may be skipped everywhere."""
    missing = set(CATALOGUE)
    for name in (SHORT, "fallbacks", "nominal", "obstacle"):
        sample = _sample(name, replace(QUICK[name], groups=()), tmp_path)
        is_applied = _is_applied(sample)
        missing = {one for one in missing if not is_applied(one)}
    assert not missing


def _is_applied(sample: Sample) -> Callable[[str], bool]:
    def is_applied(name: str) -> bool:
        for target in CATALOGUE[name].targets(sample):
            forgery = Forgery(sample.session)
            target.apply(forgery)
            if forgery.is_changed:
                return True
        return False

    return is_applied


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
    found = Sum(outcomes)
    assert found.undetected == [outcomes[1]]
    assert list(found.lines())[-1] == "2 of 3 falsifications applied 2 times: 1 detected, 1 not detected"
