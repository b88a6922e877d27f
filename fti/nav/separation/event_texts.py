"""Texts of the events of fault detection: what is excluded and why, and what ends it."""

from __future__ import annotations

from collections.abc import Iterable

from fti.constants import SECOND_NS
from fti.nav.filter.look_mark import SCAN_DRIFT
from fti.nav.separation.absence import TRIAL_NS
from fti.nav.separation.excluded_receivers import ExcludedReceiver, describe_readmission
from fti.nav.separation.monitor import SourceFault
from fti.nav.separation.readmission import AGREED_COUNT, AGREED_NS
from fti.nav.separation.source_class import SourceClass


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


def describe_still_excluded(receiver: ExcludedReceiver, restarted: str) -> str:
    """Text when a receiver stays excluded.  restarted : what has restarted"""
    return f"{receiver.label}: still refused after {restarted}; it aids again after {describe_readmission(receiver)}"


def describe_contradiction(finding: SourceFault) -> str:
    """Text when sources contradict each other and none is excluded."""
    return f"contradiction: {finding.text}; it is unknown which of the sources is wrong, none is excluded"


def describe_filter_restart(receiver: ExcludedReceiver, source: str) -> str:
    """Text when an excluded receiver and an independent source agree against the filter."""
    return f"filter: restarts: {receiver.label} and {source} agree, and contradict it"
