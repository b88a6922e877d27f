"""Verify the integrity of a recording.

This program and the official reader read every file to its end: checksums, message indexes, summary.  Every sequence
number of a frame must be present exactly once, the times of each link must ascend, and the ledger of each link,
recomputed from the frames, must balance:

  in = recorded + dropped, by reason

  socket_queue     dropped by the kernel because the recorder did not read in time; without a sequence number
  buffer_overflow  the disk accepted no data until the buffers were full: the oldest frames were dropped
  never_written    received by a recorder that was killed before it wrote them
  storage          in the buffers at the end, because the disk accepted no more data
  not_triggered    recorded on a trigger only, and there was none

The table also lists errors reported by a UART (uart_...), a CAN controller (can_...) or the controller of an adapter
(slcan_...); these counters cannot be converted to frames.

A kernel timestamp that may be from before a step of the real-time clock is refused, and its frame has the time of the
read: the check "stamps" counts these frames as loss.

Each line is a check: ok, note (holds, with a remark), loss (missing data, accounted for), refuted (does not hold).  A
single file of a session is verified by itself; a session on several media is verified from all folders together.  For
a recovered copy, messages without a valid original checksum count as loss: the checksums of the copy are new.
Exit code 0: all holds; 3: readable, and every loss is accounted for; 1: refuted.

  fti verify data/da42_20260102T030405Z_0
  fti verify data/da42_20260102T030405Z_0 --json
  fti verify /media/disk/da42_20260102T030405Z_0 spare/da42_20260102T030405Z_0
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from fti.cli._printing import print_json, print_lines

if TYPE_CHECKING:
    from fti.logger.verify.ledger import Amount
    from fti.logger.verify.report import LinkAccount, VerifyReport

CODES = {"ok": 0, "loss": 3, "refuted": 1}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION and --json."""
    parser.add_argument("session", metavar="SESSION", nargs="+", help="session folders or MCAP files of one session")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Verify and print; 3 when data are lost, 1 when a check does not hold."""
    from fti.cli._progress import show_progress
    from fti.logger.reading.recording import Recording
    from fti.logger.verify.verification import verify

    recording = Recording.open(*args.session)
    with show_progress("verifying") as show:
        report = verify(recording, lambda done, total: show("verifying", done / max(total, 1)))
    print_json(as_json(report)) if args.json else print_lines(as_text(report))
    return CODES[report.result]


# ------------------------------------------------------------------------------------------------------------- printing


def as_json(report: VerifyReport) -> dict[str, Any]:
    """The report as JSON."""
    return {
        "verdict": report.result,
        "holds": report.holds,
        "findings": report.findings,
        "files": report.files,
        "numbered": report.numbered,
        "missing": report.missing,
        "ledger": bool(report.ledgers),
        "checks": [
            {
                "name": check.name,
                "verdict": check.result,
                "text": check.text,
                "lines": [{"verdict": result, "text": text} for result, text in check.lines],
            }
            for check in report.checks
        ],
        "accounts": {account.topic: _account(account) for account in report.accounts},
        "topics": {
            name: {"messages": t.messages, "bytes": t.bytes, "longest_gap_s": t.longest_gap_ns / 1e9}
            for name, t in sorted(report.topics.items())
        },
    }


def _account(account: LinkAccount) -> dict[str, Any]:
    dropped = {reason: _amount(amount) for reason, amount in account.dropped.items()}
    amounts = {"in": _amount(account.incoming), "recorded": _amount(account.recorded)}
    return {**amounts, "dropped": dropped, "errors": account.errors, "stamps_refused": account.stamps_refused}


def _amount(amount: Amount) -> dict[str, int]:
    return {"frames": amount.frames, "bytes": amount.bytes}


def as_text(report: VerifyReport) -> list[str]:
    """The report as lines of text."""
    lines = []
    width = max(len(check.name) for check in report.checks)
    for check in report.checks:
        good = check.result in ("ok", "note")
        lines.append(f"{check.result:8}{check.name:{width}}  {check.text if good else ''}".rstrip())
        lines += [f"{'':8}{'':{width}}  {result}: {text}" for result, text in check.lines]
    if report.accounts:
        lines += ["", *_table(report.accounts)]
    conclusion = {
        "ok": f"all holds: {report.files} files, {report.numbered} numbered messages",
        "loss": "readable with losses; every known loss is listed above",
        "refuted": "refuted: the checks marked refuted above do not hold",
    }
    return [*lines, "", conclusion[report.result]]


def _table(accounts: list[LinkAccount]) -> list[str]:
    width = max(len(account.topic) for account in accounts)
    lines = [f"{'':{width}} {'frames in':>12} {'recorded':>12} {'dropped':>12} {'bytes recorded':>16}  reason"]
    for account in (a for a in accounts if a.incoming.frames or not a.topic.startswith("/tx/")):
        incoming, recorded = account.incoming.frames, account.recorded
        reasons = [f"{reason} {amount.frames}" for reason, amount in account.dropped.items()]
        reasons += [f"{name} {count}" for name, count in account.errors.items() if count]
        line = f"{account.topic:{width}} {incoming:12} {recorded.frames:12} {incoming - recorded.frames:12}"
        lines.append(f"{line} {recorded.bytes:16}  {', '.join(reasons)}".rstrip())
    return lines
