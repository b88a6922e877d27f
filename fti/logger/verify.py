"""The proof of integrity: every file readable to its end, every number there, every byte accounted for."""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader

from fti.errors import RecordingError
from fti.logger.mcap_file import FOOTER_BYTES
from fti.logger.recording import RAW, Recording
from fti.logger.records import HEAD, MAGIC
from fti.logger.survey import TopicSurvey, survey

LEDGER_TOPIC = "/fti/ledger"
#: A kernel stamp is brought to FTI time with two readings of clocks, between which the reader may be interrupted.
STAMP_TOLERANCE_NS = 1_000_000
SHOWN_RANGES = 5


@dataclass(slots=True)
class Report:
    """What was found.  findings : a sentence for each thing that does not hold; ledger : whether one was compared."""

    findings: list[str] = field(default_factory=list)
    topics: list[TopicSurvey] = field(default_factory=list)
    files: int = 0
    numbered: int = 0
    missing: int = 0
    ledger: bool = False

    @property
    def holds(self) -> bool:
        """Nothing is missing or damaged."""
        return not self.findings


@dataclass(slots=True)
class Account:
    """Frames and bytes of a link."""

    frames: int = 0
    bytes: int = 0
    last_ns: int | None = None


def verify(recording: Recording) -> Report:
    """Read everything and compare.  Raises MissingError when a file cannot be opened."""
    report = Report(files=len(recording.files))
    report.topics = survey(recording)
    report.findings += _check_files(recording, report.topics)
    if recording.raw_files:
        accounts = _check_numbers(recording, report)
        report.findings += _check_ledger(recording, accounts, report)
    return report


# ------------------------------------------------------------------------------------------------------------ files


def _check_files(recording: Recording, topics: list[TopicSurvey]) -> Iterator[str]:
    told: int | None = 0
    for path in recording.files:
        try:
            if path in recording.faults:
                raise RecordingError(recording.faults[path].text)
            count = _count_told(path)
            told = None if told is None else told + count
        except (RecordingError, McapError, ValueError) as error:
            yield f"{path.name}: {error}"
            told = None
    found = sum(topic.messages for topic in topics)
    if told is not None and told != found:
        yield f"the summaries tell of {told} messages, the files hold {found}"


def _count_told(path: Path) -> int:
    """Messages that the summary of a file tells of.  Raises RecordingError, McapError or ValueError."""
    with path.open("rb") as stream:
        summary = make_reader(stream, validate_crcs=True).get_summary()
        if summary is None or summary.statistics is None:
            raise RecordingError("has no summary")
        stream.seek(-FOOTER_BYTES, os.SEEK_END)
        start, _, crc = struct.unpack_from("<QQI", stream.read(), HEAD.size)
        stream.seek(start)
        if crc and zlib.crc32(stream.read()[: -len(MAGIC) - 4]) != crc:
            raise RecordingError("its summary is damaged")
    return summary.statistics.message_count


# ---------------------------------------------------------------------------------------------------------- numbers


def _check_numbers(recording: Recording, report: Report) -> dict[str, Account]:
    """Are all numbers there, and do the stamps of each link rise?  Returns what was found of each link."""
    accounts: dict[str, Account] = defaultdict(Account)
    missing: list[tuple[int, int]] = []
    backwards: dict[str, int] = defaultdict(int)
    expected = 0 if recording.path.is_dir() else None
    try:
        for seq, item in recording.numbered():
            if expected is not None and seq > expected:
                missing.append((expected, seq - 1))
            expected = seq + 1
            report.numbered += 1
            account = accounts[item.topic.name]
            if account.last_ns is not None and item.log_time < account.last_ns - STAMP_TOLERANCE_NS:
                backwards[item.topic.name] += 1
            account.last_ns = item.log_time
            account.frames += 1
            account.bytes += len(item.data)
    except RecordingError as error:
        report.findings.append(str(error))
    report.missing = sum(last - first + 1 for first, last in missing)
    if missing:
        report.findings.append(f"{report.missing} numbers are missing: {_shown(missing)}")
    report.findings += [f"{topic}: the time goes back {n} times" for topic, n in backwards.items()]
    return {topic.removeprefix(RAW): account for topic, account in accounts.items() if topic.startswith(RAW)}


def _shown(ranges: list[tuple[int, int]]) -> str:
    texts = [str(first) if first == last else f"{first}-{last}" for first, last in ranges[:SHOWN_RANGES]]
    return ", ".join(texts) + (f" and {len(ranges) - SHOWN_RANGES} more ranges" if len(ranges) > SHOWN_RANGES else "")


# ----------------------------------------------------------------------------------------------------------- ledger


@dataclass(slots=True)
class Ledger:
    """The books of a link: what came in, was recorded and was dropped, in all runs of the recorder."""

    in_frames: int = 0
    in_bytes: int = 0
    recorded_frames: int = 0
    recorded_bytes: int = 0
    dropped: dict[str, tuple[int, int]] = field(default_factory=dict)

    @classmethod
    def of(cls, entry: dict[str, Any]) -> Ledger:
        """The books as they stand in the file."""
        dropped = {reason: (lost["frames"], lost["bytes"]) for reason, lost in entry["dropped"].items()}
        frames, recorded = entry["in_frames"], entry["recorded_frames"]
        return cls(frames, entry["in_bytes"], recorded, entry["recorded_bytes"], dropped)

    def add(self, other: Ledger) -> None:
        """Books of another run."""
        self.in_frames += other.in_frames
        self.in_bytes += other.in_bytes
        self.recorded_frames += other.recorded_frames
        self.recorded_bytes += other.recorded_bytes
        for reason, (frames, size) in other.dropped.items():
            before = self.dropped.get(reason, (0, 0))
            self.dropped[reason] = before[0] + frames, before[1] + size


@dataclass(slots=True)
class Books:
    """The last ledger of each link.  restarted : there were several recorders; behind : frames came after the last."""

    links: dict[str, Ledger] = field(default_factory=dict)
    restarted: bool = False
    behind: bool = False


def read_books(recording: Recording) -> Books:
    """The books of a recording; when the recorder was restarted, those of all its runs together."""
    books = Books()
    current: dict[str, Ledger] = {}
    for item in recording.items("raw"):
        if item.topic.name.startswith(RAW):
            books.behind = True
        elif item.topic.name == LEDGER_TOPIC:
            books.behind = False
            for link, entry in json.loads(item.data)["links"].items():
                fresh, last = Ledger.of(entry), current.get(link)
                if last and fresh.in_frames < last.in_frames:
                    books.restarted = True
                    books.links.setdefault(link, Ledger()).add(last)
                current[link] = fresh
    for link, ledger in current.items():
        books.links.setdefault(link, Ledger()).add(ledger)
    return books


def _check_ledger(recording: Recording, accounts: dict[str, Account], report: Report) -> Iterator[str]:
    """In = recorded + dropped, and recorded = found.  Books of a killed recorder end before its frames do."""
    books = read_books(recording)
    report.ledger = bool(books.links)
    final = not (books.restarted or books.behind)
    for link, ledger in books.links.items():
        found = accounts.get(link, Account())
        for reason, (frames, size) in ledger.dropped.items():
            yield f"/raw/{link}: {frames} frames ({size} bytes) were dropped: {reason}"
        yield from _compare(f"/raw/{link}", "frames", ledger.recorded_frames, found.frames, final)
        yield from _compare(f"/raw/{link}", "bytes", ledger.recorded_bytes, found.bytes, final)
        accounted = ledger.recorded_frames + sum(frames for frames, _ in ledger.dropped.values())
        if final and ledger.in_frames != accounted:
            yield f"/raw/{link}: {ledger.in_frames} frames came in, {accounted} were recorded or dropped"


def _compare(topic: str, what: str, told: int, found: int, final: bool) -> Iterator[str]:
    if found < told or (final and found != told):
        yield f"{topic}: the ledger tells of {told} recorded {what}, the files hold {found}"
