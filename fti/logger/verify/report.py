"""What a proof says: one check after the other, the account of each link, and what it amounts to."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from fti.logger.verify.ledger import Amount


class CheckVerdict(StrEnum):
    """What a check found, from good to bad."""

    OK = "ok"
    NOTE = "note"  # holds; there is something to know
    LOSS = "loss"  # something is not there, or cannot be proved, and it is known what
    REFUTED = "refuted"  # does not hold


_ORDER = list(CheckVerdict)


@dataclass(slots=True)
class Check:
    """One thing that was proved or refuted.  text : what holds; lines : what was found beside or against it."""

    name: str
    text: str
    verdict: CheckVerdict = CheckVerdict.OK
    lines: list[tuple[CheckVerdict, str]] = field(default_factory=list)

    def add(self, verdict: CheckVerdict, text: str) -> None:
        """Something that was found."""
        self.lines.append((verdict, text))
        self.verdict = max(self.verdict, verdict, key=_ORDER.index)


@dataclass(slots=True)
class LinkAccount:
    """One link, or what was sent on it: in = recorded + dropped by reason.

    dropped : frames and bytes by reason; bytes are 0 where nobody knows them
    errors  : line errors, which have no frame of their own
    stamps_refused : frames that have the time of their reading, as the kernel's stamp was not believed
    """

    topic: str
    recorded: Amount
    dropped: dict[str, Amount] = field(default_factory=dict)
    errors: dict[str, int] = field(default_factory=dict)
    stamps_refused: int = 0

    @property
    def incoming(self) -> Amount:
        """What came in."""
        total = self.recorded
        for amount in self.dropped.values():
            total = total.plus(amount)
        return total


@dataclass(slots=True)
class TopicTotals:
    """What stands on a topic."""

    messages: int = 0
    bytes: int = 0
    last_ns: int = 0
    longest_gap_ns: int = 0


@dataclass(slots=True)
class VerifyReport:
    """What was found.  numbered : frames, ticks and sent messages; missing : numbers that stand nowhere."""

    files: int = 0
    numbered: int = 0
    missing: int = 0
    ledgers: int = 0
    checks: list[Check] = field(default_factory=list)
    accounts: list[LinkAccount] = field(default_factory=list)
    topics: dict[str, TopicTotals] = field(default_factory=dict)

    @property
    def verdict(self) -> CheckVerdict:
        """The worst of all checks; what is only told counts as good."""
        worst = max((check.verdict for check in self.checks), key=_ORDER.index, default=CheckVerdict.OK)
        return CheckVerdict.OK if worst is CheckVerdict.NOTE else worst

    @property
    def holds(self) -> bool:
        """Nothing is missing or damaged, and everything could be proved."""
        return self.verdict is CheckVerdict.OK

    @property
    def findings(self) -> list[str]:
        """A sentence for everything that is lost or does not hold."""
        bad = (CheckVerdict.LOSS, CheckVerdict.REFUTED)
        return [text for check in self.checks for verdict, text in check.lines if verdict in bad]
