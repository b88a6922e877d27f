"""What a falsification is: a name, the reason why the score must detect it, and its targets in a session."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.post.score.sabotage.message_edits import Forgery, valid_values
from tests.post.score.sabotage.score_run import ScoreReport
from tests.post.score.sabotage.session_copy import Session

#: An output is attacked in its values when it has been valid for so many messages at least.
MIN_VALID = 20
POSITIONS = ("/nav/nav_solution", "/nav/filter_solution", "/nav/position_fix")
HEIGHT, HEIGHT_BELOW = "/nav/height_above_ground", "/nav/height_below_aircraft"
GLIDE_SLOPE, INTEGRITY = "/nav/glide_slope", "/nav/clearance_integrity"
VERTICAL, LOCATION = "/nav/vertical_solution", "/nav/location"


@dataclass(frozen=True)
class Sample:
    """A session that is attacked.

    scenario : its name or file; session : its content; honest : its score; others : session folders of other
    flights, by a name that says which: ``other scenario``, ``other seed``; title : of the scenario in tables
    """

    scenario: str
    session: Session
    honest: ScoreReport
    others: Mapping[str, Path] = field(default_factory=dict)
    title: str = ""
    _values: dict[str, dict[str, list[float]]] = field(default_factory=dict, repr=False)

    @property
    def scenario_name(self) -> str:
        """What it is called in tables."""
        return self.title or self.scenario

    @property
    def outputs(self) -> list[str]:
        """The topics of navigation that the session has."""
        return self.session.topics("derived", "/nav/")

    def values(self, topic: str) -> dict[str, list[float]]:
        """Field -> the numbers of valid messages, of fields that are there often enough for a comparison."""
        if topic not in self._values:
            results = valid_values(self.session, topic)
            self._values[topic] = {name: values for name, values in results.items() if len(values) >= MIN_VALID}
        return self._values[topic]


@dataclass(frozen=True)
class Target:
    """One application.  name : what is attacked ("" where there is only one); apply : changes the forgery"""

    name: str
    apply: Callable[[Forgery], None]


@dataclass(frozen=True)
class Falsification:
    """One way to falsify a session.

    why     : the limit that it breaks, for which the score must detect it
    targets : everything in a session that can be attacked in this way; none where the session has no such thing
    """

    name: str
    why: str
    targets: Callable[[Sample], Iterator[Target]]


def of_topics(
    topics: Callable[[Sample], Sequence[str]], apply: Callable[[Forgery, str], None]
) -> Callable[[Sample], Iterator[Target]]:
    """The targets of a falsification that changes one topic at a time."""

    def targets(sample: Sample) -> Iterator[Target]:
        for topic in topics(sample):
            yield Target(topic, lambda forgery, topic=topic: apply(forgery, topic))  # type: ignore[misc]

    return targets


def once(apply: Callable[[Forgery], None]) -> Callable[[Sample], Iterator[Target]]:
    """The target of a falsification that can be applied once to any session."""
    return lambda sample: iter((Target("", apply),))


def outputs(sample: Sample) -> list[str]:
    """Every output of navigation."""
    return sample.outputs


def checked_outputs(sample: Sample) -> list[str]:
    """The outputs that are valid often enough for a comparison of values."""
    return [topic for topic in sample.outputs if sample.values(topic)]
