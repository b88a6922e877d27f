"""All falsifications, by group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tests.post.score.sabotage.configurations import CONFIGURATIONS
from tests.post.score.sabotage.falsification import Falsification
from tests.post.score.sabotage.flags import FLAGS
from tests.post.score.sabotage.labels import LABELS
from tests.post.score.sabotage.own_explanations import OWN_EXPLANATIONS
from tests.post.score.sabotage.removals import REMOVALS
from tests.post.score.sabotage.timing import TIMING
from tests.post.score.sabotage.truths import TRUTHS
from tests.post.score.sabotage.values import VALUES

GROUPS: Mapping[str, Sequence[Falsification]] = {
    "removals": REMOVALS,
    "timing": TIMING,
    "values": VALUES,
    "labels": LABELS,
    "flags": FLAGS,
    "explanations": OWN_EXPLANATIONS,
    "configurations": CONFIGURATIONS,
    "truths": TRUTHS,
}
CATALOGUE: Mapping[str, Falsification] = {one.name: one for group in GROUPS.values() for one in group}
