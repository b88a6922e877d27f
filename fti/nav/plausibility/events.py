"""Events of refusals: source, test, onset, compared values, and condition of readmission."""

from __future__ import annotations

from fti.constants import SECOND_NS
from fti.messages.outputs import Event
from fti.nav.plausibility.admission import Admission, AdmissionChange

DAY_S = 86_400


def clock_text(t_ns: int) -> str:
    """Time of day, to a tenth of a second."""
    seconds, rest = divmod(t_ns, SECOND_NS)
    hours, below = divmod(seconds % DAY_S, 3600)
    return f"{hours:02d}:{below // 60:02d}:{below % 60:02d}.{rest // 100_000_000}"


def describe_restored(t_ns: int, source: str, quantity: str, admission: Admission) -> Event:
    """Event of a refusal from before the start of this process."""
    assert admission.finding is not None
    why, since = admission.finding.reason, clock_text(admission.finding.onset_ns)
    text = f"{quantity} still refused after navigation was started again: {why}; since {since} UTC; "
    return Event(t_ns=t_ns, level="warning", source=source, text=f"{text}valid after {admission.readmission_condition}")


def describe(t_ns: int, source: str, quantity: str, admission: Admission, change: AdmissionChange) -> Event:
    """Event of a change of admission."""
    if change is AdmissionChange.VALID:
        text = f"{quantity} valid again: all tests have passed"
        return Event(t_ns=t_ns, level="info", source=source, text=text)
    if change is AdmissionChange.CLOSED:
        text = f"{quantity}: the contradiction has ended; valid after {admission.readmission_condition}"
        return Event(t_ns=t_ns, level="info", source=source, text=text)
    finding = admission.finding
    assert finding is not None
    if change is AdmissionChange.STANDING:
        text = f"{quantity} unconfirmed: a contradiction persists; valid after {admission.readmission_condition}"
        return Event(t_ns=t_ns, level="warning", source=source, text=text)
    text = f"{quantity} refused: {finding.reason}: {finding.text}; since {clock_text(finding.onset_ns)} UTC; "
    return Event(t_ns=t_ns, level="warning", source=source, text=f"{text}valid after {admission.readmission_condition}")
