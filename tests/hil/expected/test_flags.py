"""Every kind of fault has stated what the daemon must say of it."""

from __future__ import annotations

import typing

import pytest

from fti.hil.expected.device_flags import RULES
from fti.hil.tables import kinds
from fti.hil.tables.bases import OnDevices
from fti.hil.tables.kinds import FaultKind

OF_DEVICES = [
    kind
    for group in (kinds.OfValues, kinds.OfClock, kinds.OfBytes, kinds.OfPower)
    for kind in typing.get_args(group)
    if issubclass(kind, OnDevices)
]


@pytest.mark.parametrize("kind", OF_DEVICES, ids=lambda kind: kind.__name__)
def test_one_rule_is_for_each_kind_of_a_device(kind: type) -> None:
    matching = [rule for classes, rule in RULES if issubclass(kind, classes)]
    assert matching, "the daemon must say something of it, or nobody knows it yet: state which"


def test_all_kinds_are_of_the_world_of_a_device_or_of_a_line() -> None:
    stated = {typing.get_args(kind.model_fields["kind"].annotation)[0] for kind in OF_DEVICES}
    others = {"obstacle", "off_track", "babbling", "bus_off", "can_status"}
    assert stated | others == {kind.value for kind in FaultKind}
