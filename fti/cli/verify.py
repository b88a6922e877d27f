"""Prove the integrity of a recording.

Every file is readable to its end with its checksums, every number is there, the time of each link runs forward, and
the recorder's ledger agrees: bytes in = bytes recorded + bytes dropped.  Prints a sentence for each thing that does
not hold.  Exit code 0: all holds; 3: readable with losses.

  fti verify data/da42_20260102T030405Z_0
  fti verify data/da42_20260102T030405Z_0 --json
"""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fti.logger.verify import Report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION and --json."""
    parser.add_argument("session", metavar="SESSION", help="session folder or MCAP file")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Compare everything; 3 when something does not hold."""
    from fti.logger.recording import Recording
    from fti.logger.verify import verify

    report = verify(Recording.open(args.session))
    if args.json:
        print(json.dumps(as_json(report), indent=1))
    else:
        print("\n".join(as_text(report)))
    return 0 if report.holds else 3


def as_json(report: Report) -> dict[str, Any]:
    """The report, for programs."""
    counts = {
        t.topic: {"messages": t.messages, "bytes": t.bytes, "longest_gap_s": t.longest_gap_ns / 1e9}
        for t in report.topics
    }
    totals = {"files": report.files, "numbered": report.numbered, "missing": report.missing, "ledger": report.ledger}
    return {"holds": report.holds, "findings": report.findings, **totals, "topics": counts}


def as_text(report: Report) -> list[str]:
    """Lines for a person."""
    lines = [
        f"{t.topic}: {t.messages} messages, {t.bytes} bytes, longest gap {t.longest_gap_ns / 1e9:.3f} s"
        for t in report.topics
    ]
    ledger = "compared" if report.ledger else "none"
    lines.append(f"{report.files} files, {report.numbered} numbered frames, {report.missing} missing, ledger: {ledger}")
    lines += [f"does not hold: {finding}" for finding in report.findings]
    return [*lines, "all holds"] if report.holds else lines
