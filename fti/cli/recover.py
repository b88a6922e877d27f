"""Recover the data of a damaged recording, or close files that a kill left open.

Without --in-place: copies all readable data of truncated files, and of files with flipped bits or zeroed pages, as
finished files into a new folder (default: SESSION_recovered beside SESSION).  The input is never changed.  Records with
a wrong checksum are left out, so that no message is invented.  If flipping one bit makes the checksum correct, that bit
is flipped and reported.  Messages without a valid checksum (of such records, or after the last flush of an unfinished
file) are copied and counted.  The missing data are printed, and listed in recovered.json in the new folder and in each
file.  Exit code 0: nothing is missing and everything is verified; 3: something is missing, unverified, or not verified
complete, as every file without a summary.

With --in-place: a file that a kill or a power cut left open gets its index, summary and footer, so that every reader
accepts it.  No byte is removed: bytes after the last readable record are saved in FILE.rest-at-OFFSET.bin beside it.
A file that is being written, or is damaged before its end, is left unchanged.  Then the session is verified; exit code
3 when a check fails.  The next `fti run` closes files in the same way, in all sessions in its directory.

  fti recover data/da42_20260102T030405Z_0
  fti recover broken.mcap --out saved --json
  fti recover data/da42_20260102T030405Z_0 --in-place
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fti.cli._printing import print_json, print_line, print_lines

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fti.logger.recovery.report import FileReport, RecoveryReport

MAX_SHOWN = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION, --out or --in-place, --json."""
    parser.add_argument("session", metavar="SESSION", help="session folder or MCAP file")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--out", metavar="DIR", help="write the recovered files into DIR, which must be empty")
    how.add_argument("--in-place", action="store_true", help="only close the unfinished files, without a copy")
    parser.add_argument("--json", action="store_true", help="print JSON only (not with --in-place)")


def run(args: argparse.Namespace) -> int:
    """Recover; 3 when something is missing or a file was left unchanged."""
    if args.in_place:
        return _close(args.session)
    return _extract(Path(args.session), Path(args.out) if args.out else None, as_json=args.json)


def _close(session: str) -> int:
    """Close the files, then verify the session if one was open; 3 when a check fails or a file was left unchanged."""
    from fti.cli._progress import show_progress
    from fti.errors import RecordingError, StorageError
    from fti.logger.reading.recording import Recording
    from fti.logger.recovery.close_unfinished import close_unfinished
    from fti.logger.verify.verification import verify

    code, is_changed = 0, False
    for path in Recording.open(session).files:
        try:
            with show_progress(f"closing {path.name}"):
                closed = close_unfinished(path)
        except (RecordingError, StorageError) as error:
            print_line(f"fti: {error}", error=True)
            code = 3
            continue
        if closed is None:
            print_line(f"{path}: is finished")
            continue
        print_line(closed.describe_loss() or f"{path}: closed")
        print_line(f"{path}: holds {closed.messages} messages")
        is_changed = True
    if not is_changed:
        return code
    with show_progress("verifying") as show:
        report = verify(Recording.open(session), lambda done, total: show("verifying", done / max(total, 1)))
    if report.holds:
        return code
    print_lines(report.findings[:MAX_SHOWN])
    print_line(f"not verified to be complete; all findings: fti verify {session}")
    return 3


def _extract(session: Path, out: Path | None, *, as_json: bool) -> int:
    from fti.cli._progress import show_progress
    from fti.logger.recovery.extract import extract_session, session_files

    total = sum(path.stat().st_size for path in session_files(session))
    folder = out or session.absolute().with_name(f"{session.absolute().stem}_recovered")
    with show_progress("copying") as show:
        report = extract_session(session, folder, lambda done: show("copying", done / max(total, 1)))
    if as_json:
        print_json({"out": str(folder), **report.as_json()})
    else:
        print_lines(as_text(report))
        print_line(f"recovered into {folder}")
    return 0 if report.complete else 3


def as_text(report: RecoveryReport) -> Iterator[str]:
    """The report as lines of text."""
    for file in report.files:
        yield from _file_text(file)
    for gap in report.gaps[:MAX_SHOWN]:
        yield f"numbers {gap.first}-{gap.last} are missing, between {_time(gap.first_ns)} and {_time(gap.last_ns)}"
    if len(report.gaps) > MAX_SHOWN:
        yield f"and {len(report.gaps) - MAX_SHOWN} more ranges of numbers; see recovered.json"
    yield _conclusion(report)


def _conclusion(report: RecoveryReport) -> str:
    if report.complete:
        return "nothing is missing"
    if report.gaps or any(file.lost for file in report.files):
        return "data are missing"
    if any(not file.summary for file in report.files):
        return "not verified to be complete: a file has no valid summary, data may be missing at its end"
    if any(file.warnings for file in report.files):
        return "not everything is verified: a file was not finished by its writer, or was recovered before"
    return "nothing is missing; not everything is verified"


def _file_text(file: FileReport) -> Iterator[str]:
    unverified = f" ({file.unverified} without a checksum that covers them)" if file.unverified else ""
    yield (
        f"{file.file}: {file.messages} messages{unverified}, "
        f"{file.attachments} attachments, {file.metadata} metadata records recovered"
    )
    if file.unverified_ns is not None:
        yield f"  the first unverified message is at {_time(file.unverified_ns)}"
    if not file.summary:
        yield "  has no valid summary: not verified to be complete, data may be missing at its end"
    for warning in file.warnings:
        yield f"  {warning}"
    for name in file.altered_metadata:
        yield f"  the checksum of its metadata {name} does not match"
    if file.copies:
        yield f"  {file.copies} messages are also in an earlier one of the joined files, and are copied once"
    for byte in file.flipped[:MAX_SHOWN]:
        yield f"  a bit of byte {byte} was flipped back, so that its chunk has a valid checksum: likely, not certain"
    if len(file.flipped) > MAX_SHOWN:
        yield f"  and {len(file.flipped) - MAX_SHOWN} more bits; see recovered.json"
    for damage in file.damages[:MAX_SHOWN]:
        yield f"  bytes {damage.begin}-{damage.end - 1} are lost, {_interval_text(damage.after_ns, damage.before_ns)}"
    if len(file.damages) > MAX_SHOWN:
        yield f"  and {len(file.damages) - MAX_SHOWN} more places; see recovered.json"
    if file.damages and file.complete:
        yield "  they held no message, attachment or metadata"
    if file.missing_messages:
        yield f"  {file.missing_messages} of {file.summary_messages} messages are missing"


def _interval_text(after_ns: int | None, before_ns: int | None) -> str:
    begin = "before" if after_ns is None else f"after {_time(after_ns)}"
    if before_ns is None:
        return f"{begin} the end" if after_ns is None else begin
    return f"{begin} {_time(before_ns)}" if after_ns is None else f"{begin} and before {_time(before_ns)}"


def _time(t_ns: int) -> str:
    """FTI time as a date, to the millisecond."""
    from datetime import UTC, datetime

    try:
        return f"{datetime.fromtimestamp(t_ns // 10**9, UTC):%Y-%m-%dT%H:%M:%S}.{t_ns // 10**6 % 1000:03d}Z"
    except (OverflowError, ValueError, OSError):  # a foreign file may hold any number
        return f"{t_ns} ns"
