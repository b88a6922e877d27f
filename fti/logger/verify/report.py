"""Report of a verification: checks, the account of each link, and the result."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from fti.logger.verify.ledger import Amount


class CheckResult(StrEnum):
    """Result of a check, from good to bad."""

    OK = "ok"
    NOTE = "note"  # passed, with a remark
    LOSS = "loss"  # known data are missing or cannot be verified
    REFUTED = "refuted"  # failed


_ORDER = list(CheckResult)


@dataclass(slots=True)
class Check:
    """Result of one check.  text : the checked statement; lines : remarks and findings against it."""

    name: str
    text: str
    result: CheckResult = CheckResult.OK
    lines: list[tuple[CheckResult, str]] = field(default_factory=list)

    def add(self, result: CheckResult, text: str) -> None:
        """Add a remark or finding."""
        self.lines.append((result, text))
        self.result = max(self.result, result, key=_ORDER.index)


@dataclass(slots=True)
class LinkAccount:
    """Received or sent data of one link: in = recorded + dropped by reason.

    dropped : frames and bytes by reason; unknown bytes are 0
    errors  : line errors, which have no frames
    stamps_refused : frames with the time of reading, because the kernel timestamp was refused
    """

    topic: str
    recorded: Amount
    dropped: dict[str, Amount] = field(default_factory=dict)
    errors: dict[str, int] = field(default_factory=dict)
    stamps_refused: int = 0

    @property
    def incoming(self) -> Amount:
        """Received frames and bytes."""
        total = self.recorded
        for amount in self.dropped.values():
            total = total.plus(amount)
        return total


@dataclass(slots=True)
class TopicTotals:
    """Totals of a topic."""

    messages: int = 0
    bytes: int = 0
    last_ns: int = 0
    longest_gap_ns: int = 0


@dataclass(slots=True)
class VerifyReport:
    """Result of a verification.  numbered : frames, ticks and sent messages; missing : numbers in no file."""

    files: int = 0
    numbered: int = 0
    missing: int = 0
    ledgers: int = 0
    checks: list[Check] = field(default_factory=list)
    accounts: list[LinkAccount] = field(default_factory=list)
    topics: dict[str, TopicTotals] = field(default_factory=dict)

    @property
    def result(self) -> CheckResult:
        """The worst result of all checks; notes count as good."""
        worst = max((check.result for check in self.checks), key=_ORDER.index, default=CheckResult.OK)
        return CheckResult.OK if worst is CheckResult.NOTE else worst

    @property
    def holds(self) -> bool:
        """Is nothing missing or damaged, and is everything verified?"""
        return self.result is CheckResult.OK

    @property
    def findings(self) -> list[str]:
        """A sentence for each loss and each failed check."""
        bad = (CheckResult.LOSS, CheckResult.REFUTED)
        return [text for check in self.checks for result, text in check.lines if result in bad]
