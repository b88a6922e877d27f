"""A receiver, or its heights only, that the filter excludes, and the texts of its events."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from fti.constants import SECOND_NS
from fti.nav.confirmation import Size
from fti.nav.filter.look_mark import SCAN_DRIFT
from fti.nav.separation.absence import TRIAL_NS
from fti.nav.separation.monitor import SourceFault
from fti.nav.separation.readmission import AGREED_COUNT, AGREED_NS, ReadmissionCheck
from fti.nav.separation.source_class import SourceClass


@dataclass(slots=True)
class ExcludedReceiver:
    """A receiver, or its heights only, that does not aid.

    label : for texts;  is_announced : whether an event has reported that it agrees and stays unconfirmed
    """

    device: str
    label: str
    onset_ns: int
    readmission_check: ReadmissionCheck
    is_announced: bool = False

    @property
    def names(self) -> frozenset[str]:
        """Names of ``Aiding``."""
        return frozenset(self.readmission_check.contradictions)


def size_of(receiver: ExcludedReceiver) -> Size:
    """Size of the contradiction of position and height; one of the velocity only has no size in metres."""
    contradictions = {name.rpartition(".")[2]: c for name, c in receiver.readmission_check.contradictions.items()}
    known = {name: c.size for name, c in contradictions.items() if c.outside_ns is not None}
    horizontal = known.get("position", 0.0)
    return Size(horizontal if horizontal > 0.0 else None, known.get("height"))


def describe_readmission(receiver: ExcludedReceiver) -> str:
    """The ways to readmit a receiver or its heights, as far as known."""
    check, command = receiver.readmission_check, f"'fti readmit {receiver.device}'"
    ways = ["a step back that ends the contradiction"] if check.is_known and check.is_outside else []
    if check.is_resolvable:
        ways.append(f"a sigma of the filter below {check.describe_resolved()}")
    if receiver.label == receiver.device and (size_of(receiver).horizontal or 0.0) > 0.0:
        ways.append("agreement of an independent source")
    if not ways:
        return command
    agreed = f"{AGREED_NS // SECOND_NS} s and {AGREED_COUNT} fixes inside the gate of the filter"
    return f"{agreed} and {' or '.join(ways)}; or {command}"


def describe_exclusion(device: str, label: str, finding: SourceFault, t_ns: int) -> str:
    """Text at the exclusion of a receiver."""
    since_s, age_s, remark = (t_ns - finding.onset_ns) / SECOND_NS, 0.0, ""
    if finding.copy is not None:
        age_s = (t_ns - finding.copy.began_ns) / SECOND_NS
        remark = "" if finding.onset_ns >= finding.copy.began_ns else "; it may have contradicted before that"
    return (
        f"{label}: refused: {finding.text}, for {since_s:.0f} s; the filter continues as it was without it for"
        f" {age_s:.0f} s{remark}; it aids again when the contradiction ends by a step, or by 'fti readmit {device}'"
    )


def describe_misled(group: SourceClass, names: Iterable[str], finding: SourceFault, t_ns: int) -> str:
    """Text when airspeed and heading are excluded instead of a class of sources."""
    assert finding.copy is not None
    age_s = (t_ns - finding.copy.began_ns) / SECOND_NS
    return (
        f"{' and '.join(sorted(names))}: excluded: {' and '.join(group.devices)} came back outside the gate of the"
        f" filter, and agrees with the filter without them; it continues as it was without them for {age_s:.0f} s"
    )


def describe_wrong_drift(finding: SourceFault, t_ns: int) -> str:
    """Text when drifts between looks are excluded without satellites."""
    assert finding.copy is not None
    since_s, age_s = (t_ns - finding.onset_ns) / SECOND_NS, (t_ns - finding.copy.began_ns) / SECOND_NS
    return (
        f"{SCAN_DRIFT}: excluded: {finding.text}, for {since_s:.0f} s; the filter continues as it was without it for"
        f" {age_s:.0f} s"
    )


def describe_return(group: SourceClass) -> str:
    """Text when a class returns after a long absence."""
    return (
        f"{' and '.join(group.devices)}: back after {group.absence.absence_s:.0f} s; for {TRIAL_NS // SECOND_NS} s"
        " the protection levels stay those of the filter without satellites; reacquired until all copies exist again"
    )


def describe_unconfirmed(receiver: ExcludedReceiver) -> str:
    """Text when a receiver agrees again and its contradiction persists."""
    return (
        f"{receiver.label}: agrees again for {AGREED_NS // SECOND_NS} s and {AGREED_COUNT} fixes, unconfirmed; it aids"
        f" again after {describe_readmission(receiver)}"
    )
