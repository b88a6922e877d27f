"""Compare the received data of two sessions, by a hash of each link; or show the hashes of one session.

A recorded replay must be equal: on a serial line the same bytes in the same order, on UDP and CAN the same frames.
Arrival times and the boundaries of serial reads are not compared.

Exit code 0: every link is equal; 1: a link differs; 3: the links are equal as far as the files can be read.

  fti compare data/da42_20260102T030405Z_0
  fti compare data/da42_20260102T030405Z_0 data/da42_20260103T030405Z_0
  fti compare data/da42_20260102T030405Z_0 data/da42_20260103T030405Z_0 --only gnss_line
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fti.cli._printing import print_json, print_lines
from fti.cli.main import EXIT_LOSSES

if TYPE_CHECKING:
    from fti.logger.reading.recording import Recording
    from fti.logger.verify.link_hash import LinkHash

SHOWN_DIGITS = 16


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION, another one, --only and --json."""
    parser.add_argument("session", metavar="SESSION", help="session folder or MCAP file")
    parser.add_argument("other", metavar="OTHER", nargs="?", help="session to compare with, such as its replay")
    parser.add_argument(
        "--only",
        type=lambda text: text.split(","),
        metavar="LINK[,LINK]",
        help="only these links, as fti replay --only",
    )
    parser.add_argument("--json", action="store_true", help="print JSON only, with whole hashes")


def run(args: argparse.Namespace) -> int:
    """Show or compare; 1 when a link differs, 3 when a file could not be read to its end."""
    from fti.cli._read_report import report_faults
    from fti.logger.reading.recording import Recording

    sessions = [Recording.open(name) for name in (args.session, args.other) if name]
    first, *others = (_hashes(recording, args.only) for recording in sessions)
    second = others[0] if others else None
    results = {} if second is None else {link: _result(first.get(link), second.get(link)) for link in first | second}
    print_json(_as_json(first, second, results)) if args.json else print_lines(_as_text(first, second, results))
    if any(result != "EQUAL" for result in results.values()):
        return 1
    for recording in sessions:
        report_faults(recording)
    return EXIT_LOSSES if any(recording.faults for recording in sessions) else 0


def _hashes(recording: Recording, only: list[str] | None) -> dict[str, LinkHash]:
    """The hashes of a session.  Raises MissingError when a link of ``only`` is missing."""
    from fti.cli._read_report import show_read_progress
    from fti.errors import MissingError
    from fti.logger.verify.link_hash import link_hashes

    with show_read_progress(recording, f"reading {recording.path}", files=recording.frame_files):
        found = link_hashes(recording)
    for name in only or ():
        if name not in found:
            raise MissingError(f"{recording.path}: no link {name!r}; links: {', '.join(found)}")
    return {link: hash_ for link, hash_ in found.items() if only is None or link in only}


def _result(first: LinkHash | None, second: LinkHash | None) -> str:
    if first is None or second is None:
        return "only in the other session" if first is None else "not in the other session"
    if first.is_same(second):
        return "EQUAL"
    return f"DIFFERENT: the other has {second.frames} frames, {second.bytes} bytes, {second.sha256[:SHOWN_DIGITS]}"


def _as_text(first: dict[str, LinkHash], second: dict[str, LinkHash] | None, results: dict[str, str]) -> list[str]:
    links = first | {link: hash_ for link, hash_ in (second or {}).items() if link not in first}
    width = max(map(len, links), default=0)
    return [
        f"{link:{width}} {hash_.kind:6} {hash_.frames:9} frames {hash_.bytes:12} bytes  "
        f"sha256 {hash_.sha256[:SHOWN_DIGITS]}  {results.get(link, '')}".rstrip()
        for link, hash_ in links.items()
    ]


def _as_json(
    first: dict[str, LinkHash], second: dict[str, LinkHash] | None, results: dict[str, str]
) -> dict[str, object]:
    from dataclasses import asdict

    table: dict[str, object] = {"links": {link: asdict(hash_) for link, hash_ in first.items()}}
    if second is not None:
        table["other"] = {link: asdict(hash_) for link, hash_ in second.items()}
        table["equal"] = {link: result == "EQUAL" for link, result in results.items()}
    return table
