"""A receiver that the filter excludes, or its heights alone; what is said of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from fti.nav.separation.absence import TRIAL_NS
from fti.nav.separation.monitor import SourceFault
from fti.nav.separation.readmission import AGREED_COUNT, AGREED_NS, ReadmissionCheck
from fti.nav.separation.source_class import SECOND_NS, SourceClass
from fti.nav.witnesses import Size


@dataclass(slots=True)
class ExcludedReceiver:
    """A receiver, or its heights alone, that does not aid.

    what : for texts;  announced : whether it was said that it agrees and stays unconfirmed
    """

    device: str
    what: str
    onset_ns: int
    back: ReadmissionCheck
    is_announced: bool = False

    @property
    def names(self) -> frozenset[str]:
        """Of ``Aiding``."""
        return frozenset(self.back.contradictions)


def size_of(refused: ExcludedReceiver) -> Size:
    """Of position and height; a contradiction of the velocity alone has no size in metres."""
    found = {name.rpartition(".")[2]: c for name, c in refused.back.contradictions.items()}
    known = {name: c.size for name, c in found.items() if c.outside_ns is not None}
    level = known.get("position", 0.0)
    return Size(level if level > 0.0 else None, known.get("height"))


def describe_readmission(refused: ExcludedReceiver) -> str:
    """What would let a receiver back in, or its height, as far as it is known."""
    back, command = refused.back, f"'fti readmit {refused.device}'"
    ways = ["a step back that ends the contradiction"] if back.is_known and back.is_outside else []
    if back.is_resolvable:
        ways.append(f"a sigma of the filter below {back.describe_resolved()}")
    if refused.what == refused.device and (size_of(refused).level or 0.0) > 0.0:
        ways.append("agreement of an independent source")
    if not ways:
        return command
    agreed = f"{AGREED_NS // SECOND_NS} s and {AGREED_COUNT} fixes inside the gate of the filter"
    return f"{agreed} and {' or '.join(ways)}; or {command}"


def describe_exclusion(device: str, what: str, finding: SourceFault, t_ns: int) -> str:
    """Of a receiver, at its exclusion."""
    since_s, age_s, before = (t_ns - finding.onset_ns) / SECOND_NS, 0.0, ""
    if finding.copy is not None:
        age_s = (t_ns - finding.copy.began_ns) / SECOND_NS
        before = "" if finding.onset_ns >= finding.copy.began_ns else "; it may have contradicted before that"
    return (
        f"{what}: refused: {finding.text}, for {since_s:.0f} s; the filter goes on as it was without it for"
        f" {age_s:.0f} s{before}; it aids again when the contradiction ends by a step, or by 'fti readmit {device}'"
    )


def describe_misled(watched: SourceClass, names: Iterable[str], finding: SourceFault, t_ns: int) -> str:
    """Of airspeed and heading that are excluded in place of a class of sources."""
    assert finding.copy is not None
    age_s = (t_ns - finding.copy.began_ns) / SECOND_NS
    return (
        f"{' and '.join(sorted(names))}: excluded: {' and '.join(watched.devices)} came back outside the gate of the"
        f" filter, and agrees with the filter without them; it goes on as it was without them for {age_s:.0f} s"
    )


def describe_return(watched: SourceClass) -> str:
    """Of a class that comes back after a long absence."""
    return (
        f"{' and '.join(watched.devices)}: back after {watched.absence.absence_s:.0f} s; for {TRIAL_NS // SECOND_NS} s"
        " the protection levels stay those of the filter without satellites; reacquired until all copies exist again"
    )


def describe_unconfirmed(refused: ExcludedReceiver) -> str:
    """Of a receiver that agrees again, which proves nothing."""
    return (
        f"{refused.what}: agrees again for {AGREED_NS // SECOND_NS} s and {AGREED_COUNT} fixes, unconfirmed; it aids"
        f" again after {describe_readmission(refused)}"
    )
