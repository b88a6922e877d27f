"""What must hold of a damaged open file after each way: sentences for what does not."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from tests.logger.campaign.commands import Result
from tests.logger.campaign.damage import DamagedFile
from tests.logger.campaign.mcap_parser import (
    ATTACHMENT,
    CHANNEL,
    CHUNK,
    CHUNK_HEAD_BYTES,
    METADATA,
    SCHEMA,
    Content,
    Message,
    ParsedFile,
    Record,
    parse,
)
from tests.logger.campaign.official_file import OfficialFile, read_officially
from tests.logger.campaign.open_sessions import SECOND_NS, STEP_NS, OpenSession

#: Since the last sync: a second, and the sync itself.
UNPROVED_NS = SECOND_NS + 5 * STEP_NS
#: The same where it may look as if a power cut had come before the last sync had ended.
UNPROVED_TWICE_NS = UNPROVED_NS + SECOND_NS
#: Of a channel whose declaration is lost.
UNNAMED = "/recovered/channel_"
TOO_GOOD = ("all holds", "nothing is missing")


class Truth:
    """What a damaged file had been, and what of it is intact."""

    def __init__(self, session: OpenSession, damaged: DamagedFile) -> None:
        self.session = session
        self.damaged = damaged
        self._original = session.data
        there = [m for m in session.parsed.messages if m.begin < len(damaged.data)]
        self.end_ns = max((m.content.log_time for m in there), default=0)
        self.unverified_ns = UNPROVED_TWICE_NS if damaged.twice else UNPROVED_NS

    def is_intact(self, begin: int, end: int) -> bool:
        """Are these bytes as they were?"""
        return end <= len(self.damaged.data) and self.damaged.data[begin:end] == self._original[begin:end]

    @cached_property
    def messages(self) -> Counter[Content]:
        """All that were there."""
        return Counter(message.content for message in self.session.parsed.messages)

    @cached_property
    def intact(self) -> list[Message]:
        """Messages whose bytes are as they were."""
        return [m for m in self.session.parsed.messages if self.is_intact(m.begin, m.end)]

    @cached_property
    def harmed(self) -> list[Message]:
        """Messages whose bytes are there, and are not as they were."""
        size = len(self.damaged.data)
        return [m for m in self.session.parsed.messages if m.end <= size and not self.is_intact(m.begin, m.end)]

    @cached_property
    def hit_times(self) -> list[int]:
        """Log times of the messages at both sides of each altered byte."""
        messages = self.session.parsed.messages
        begins = [message.begin for message in messages]
        found = set()
        for at in differences(self._original, self.damaged.data):
            n = bisect_right(begins, at)
            found |= {message.content.log_time for message in messages[max(0, n - 1) : n + 1]}
        return sorted(found)

    @cached_property
    def checkpoints_cover_more(self) -> bool:
        """Is the file shorter than the head of its last chunk, or a record at its end, tells?"""
        if self.is_cut:
            size, ops = len(self.damaged.data), (CHUNK, ATTACHMENT, METADATA)
            return any(r.begin < size < r.end for r in self.session.parsed.of(*ops))
        data = self.damaged.data
        heads = [r.begin for r in self.session.parsed.of(CHUNK) if data[r.begin : r.begin + 1] == bytes([CHUNK])]
        return any(at + 9 + int.from_bytes(data[at + 1 : at + 9], "little") > len(data) for at in heads)

    @cached_property
    def is_cut(self) -> bool:
        """Is nothing but the end of it missing?"""
        return len(self.damaged.data) < len(self._original) and self._original.startswith(self.damaged.data)

    def is_late(self, offset: int) -> bool:
        """Does a byte stand in the last second?"""
        message = self.session.parsed.message_at(offset)
        return message is None or message.content.log_time > self.end_ns - self.unverified_ns

    @cached_property
    def is_harmed_early(self) -> bool:
        """Is something altered that a sync had verified: a message, a declaration, a table, an attachment?"""
        hit = [r for r in self.session.parsed.of(SCHEMA, CHANNEL, METADATA, ATTACHMENT) if self._is_altered(r)]
        declared = any(not self._is_before_late(r) for r in hit if r.op in (SCHEMA, CHANNEL))
        others = any(self._is_followed(r) for r in hit if r.op in (METADATA, ATTACHMENT))
        return declared or others or any(m.content.log_time <= self.end_ns - self.unverified_ns for m in self.harmed)

    def _is_altered(self, record: Record) -> bool:
        return record.end <= len(self.damaged.data) and not self.is_intact(record.begin, record.end)

    def _is_before_late(self, record: Record) -> bool:
        """Is the next message of the last second?"""
        later = (m for m in self.session.parsed.messages if m.begin >= record.end)
        return (late := next(later, None)) is None or self.is_late(late.begin)

    def _is_followed(self, record: Record) -> bool:
        """Is there a whole record behind it?  Else it may be a torn write."""
        there = (r for r in self.session.parsed.top_level() if r.begin >= record.end)
        return any(self.is_intact(r.begin, r.end) for r in there)


def check_command(result: Result, allowed: tuple[int, ...]) -> Iterator[str]:
    """It comes to its end, with one of these exit codes."""
    if result.crash:
        yield f"{result.command}: traceback: {result.crash.strip().splitlines()[-1]}"
    elif result.code not in allowed:
        yield f"{result.command}: exit code {result.code}, allowed {allowed}: {last_line(result)}"
    if 0 not in allowed:
        for text in TOO_GOOD:
            if f"{text}\n" in result.text or f"{text}:" in result.text:
                yield f"{result.command}: prints {text!r}"


def last_line(result: Result) -> str:
    """The last thing that a command printed."""
    return (result.text.strip().splitlines() or ["nothing"])[-1]


def check_open(truth: Truth, verified: Result) -> Iterator[str]:
    """``fti verify`` of the file as it lies."""
    yield from check_command(verified, (1,) if truth.is_harmed_early else (1, 3))


# -------------------------------------------------------------------------------------------------------------- copies


@dataclass(slots=True)
class CopyCheck:
    """A copy that ``fti recover`` made of a folder.

    lost : intact messages that are not in it; altered : messages in it that nobody wrote
    """

    truth: Truth
    result: Result
    folder: Path
    lost: int = 0
    lost_early: int = 0
    altered: int = 0
    unnamed: int = 0
    faults: list[str] = field(default_factory=list)

    def run(self) -> list[str]:
        """Check it; sentences for what does not hold."""
        self.faults += check_command(self.result, (3,))
        files = {file["file"]: file for file in self.result.json().get("files", [])}
        path = self.folder / self.truth.session.open_name
        if not path.exists():
            self.faults.append("recover: no copy")
            return self.faults
        copy = read_officially(path)
        if copy.fault:
            self.faults.append(f"recover: the official reader refuses the copy: {copy.fault}")
            return self.faults
        self._check_messages(copy, files.get(self.truth.session.open_name, {}))
        self._check_others(copy, files.get(self.truth.session.open_name, {}))
        return self.faults

    def _check_messages(self, copy: OfficialFile, report: dict[str, object]) -> None:
        total = copy.messages.total()
        if not total == copy.counted == report.get("messages"):
            self.faults.append(
                f"recover: {total} messages by the official reader, {copy.counted} by the summary, "
                f"{report.get('messages')} by the report"
            )
        strange = copy.messages - self.truth.messages
        self.unnamed = sum(n for content, n in strange.items() if content.channel[0].startswith(UNNAMED))
        self.altered = strange.total() - self.unnamed
        unverified = report.get("unproved", 0)
        if self.altered and self.altered > int(str(unverified)):
            self.faults.append(f"recover: {self.altered} altered messages in the copy, {unverified} counted unverified")
        missing = Counter(m.content for m in self.truth.intact) - copy.messages
        self.lost = max(0, missing.total() - self.unnamed)
        hit = self.truth.hit_times
        self.lost_early = sum(
            n for content, n in missing.items() if not any(abs(content.log_time - at) < UNPROVED_NS for at in hit)
        )

    def _check_others(self, copy: OfficialFile, report: dict[str, object]) -> None:
        if not report.get("altered_metadata"):
            self.faults += [f"recover: altered {name} in the copy" for name in altered_others(self.truth, copy)]

    def check_verified(self, verified: Result) -> Iterator[str]:
        """``fti verify`` of the copy."""
        yield from check_command(verified, (1, 3))


def altered_others(truth: Truth, file: OfficialFile) -> list[str]:
    """Names of attachments and metadata that are not as they were written."""
    original = _originals(truth.session)
    altered = [name for name, kind, data in file.attachments if (name, kind, data) not in original.attachments]
    ours = ("fti.closed", "fti.recovered")
    return altered + [
        name for name, table in file.metadata.items() if name not in ours and original.metadata.get(name) != table
    ]


def _originals(session: OpenSession) -> OfficialFile:
    """Attachments and metadata of a session: the same in each of its files; from the records themselves."""
    file = OfficialFile()
    for record in session.parsed.of(ATTACHMENT, METADATA):
        body = session.data[record.begin + 9 : record.end]
        if record.op == METADATA:
            name, at = _text(body, 0)
            table, at = {}, at + 4
            while at < len(body):
                key, at = _text(body, at)
                table[key], at = _text(body, at)
            file.metadata[name] = table
        else:
            name, at = _text(body, 16)
            kind, at = _text(body, at)
            file.attachments.append((name, kind, body[at + 8 : -4]))
    return file


def _text(body: bytes, at: int) -> tuple[str, int]:
    size = int.from_bytes(body[at : at + 4], "little")
    return body[at + 4 : at + 4 + size].decode(), at + 4 + size


# ------------------------------------------------------------------------------------------------------------- closing


@dataclass(slots=True)
class ClosingCheck:
    """The folder after the next start or ``recover --in-place``.

    closed  : the file is finished now; else it was left alone
    rest    : intact messages that are in the file beside it; unverified : messages that the file calls so
    missing : intact messages that are not in the closed file
    """

    truth: Truth
    folder: Path
    closed: bool = False
    altered: int = 0
    rest: int = 0
    unverified: int = 0
    missing: int = 0
    complete: bool = False
    faults: list[str] = field(default_factory=list)

    def run(self, reported: str) -> list[str]:
        """Check it.  reported : why the file was left alone, or what its closing cost; empty when nothing."""
        session, data = self.truth.session, self.truth.damaged.data
        path = self.folder / session.open_name
        other_files = sorted(p for p in self.folder.iterdir() if p.name not in session.files)
        for name in session.finished:
            if (self.folder / name).read_bytes() != session.files[name]:
                self.faults.append(f"closing: {name}, which was finished, is another")
        now = path.read_bytes()
        if now == data:
            if other_files:
                self.faults.append(f"closing: the file was left alone, but there is {other_files[0].name}")
            if session.open_name not in reported:
                self.faults.append("closing: the file was left alone, and nobody says so")
            return self.faults
        self.closed = True
        self._check_bytes(now, other_files)
        self._check_content(path, now, reported)
        return self.faults

    def _check_bytes(self, now: bytes, other_files: list[Path]) -> None:
        """Every byte is at its place, in the file beside, or zero; the head of the last chunk may be another."""
        data = self.truth.damaged.data
        results: dict[int, bytes] = {}
        for path in other_files:
            begin = path.stem.rpartition(".rest-at-")[2]
            if not begin.isdigit() or not path.name.startswith(Path(self.truth.session.open_name).stem):
                self.faults.append(f"closing: a strange file {path.name}")
                continue
            results[int(begin)] = path.read_bytes()
        heads = [record.begin for record in _parse_or_none(now).of(CHUNK)][-1:]
        removed = []
        for at in differences(data, now):
            in_head = any(head <= at < head + CHUNK_HEAD_BYTES for head in heads)
            in_rest = any(
                begin <= at < begin + len(rest) and rest[at - begin] == data[at] for begin, rest in results.items()
            )
            if not (in_head or in_rest or data[at] == 0):
                removed.append(at)
        if removed:
            intact = {message.begin for message in self.truth.intact}
            hit = (self.truth.session.parsed.message_at(at) for at in removed)
            lost = {message.begin for message in hit if message} & intact
            text = f"{len(removed)} bytes are missing from byte {removed[0]} on, {len(lost)} intact messages among them"
            self.faults.append(f"closing: {text}")
        self.rest = sum(1 for m in self.truth.intact if any(b <= m.begin < b + len(r) for b, r in results.items()))

    def _check_content(self, path: Path, now: bytes, reported: str) -> None:
        official, own = read_officially(path), _parse_or_none(now)
        if official.fault:
            self.faults.append(f"closing: the official reader refuses the closed file: {official.fault}")
            return
        if not own.has_summary:
            self.faults.append("closing: the closed file cannot be read to its summary")
            return
        if not official.messages.total() == official.counted == len(own.messages):
            self.faults.append(
                f"closing: {official.messages.total()} messages by the official reader, "
                f"{official.counted} by the summary, {len(own.messages)} in the file"
            )
        about = official.metadata.get("fti.closed", {})
        self.unverified = int(about.get("unproved_messages", "0"))
        self._check_altered(own, about)
        self.faults += [f"closing: seals altered {name}" for name in altered_others(self.truth, official)]
        have = Counter(m.content for m in own.messages)
        self.complete = have == self.truth.messages and not self.unverified
        missing = Counter(m.content for m in self.truth.intact) - have
        self.missing = missing.total()
        if (missing or self.altered or self.unverified) and not reported:
            self.faults.append(f"closing: {missing.total()} messages are not in the file, and nobody says so")

    def _check_altered(self, own: ParsedFile, about: dict[str, str]) -> None:
        strange = [(n, m) for n, m in enumerate(own.messages) if m.content not in self.truth.messages]
        self.altered = len(strange)
        early = [m for _, m in strange if not self.truth.is_late(m.begin)]
        if early:
            self.faults.append(f"closing: {len(early)} altered messages sealed that are older than a second")
        first = len(own.messages) - self.unverified
        hidden = [m for n, m in strange if n < first]
        if hidden:
            self.faults.append(f"closing: {len(hidden)} altered messages sealed that are not counted unverified")
        since = min((m.content.log_time for m in own.messages[first:]), default=None)
        if self.unverified and about.get("unproved_from_ns") != str(since):
            self.faults.append(f"closing: unverified from {about.get('unproved_from_ns')}, should be {since}")

    def check_verified(self, folder: Result, file: Result) -> Iterator[str]:
        """``fti verify`` afterwards, of the session and of its file."""
        if not self.closed:
            yield from check_open(self.truth, folder)
            return
        yield from check_command(folder, (1, 3))
        unknown = not (
            self.altered or self.unverified or self.missing or self.rest or self.truth.checkpoints_cover_more
        )
        yield from check_command(file, (0, 1, 3) if self.complete or unknown else (1, 3))
        refuted = [r.command for r in (folder, file) if r.code == 1]
        if refuted and self.truth.damaged.natural and not self.altered:
            lines = [line.strip() for line in (folder.text + file.text).splitlines() if "refuted: " in line]
            yield f"verify refutes a closed file in which nothing is altered: {'; '.join(lines)}"


def _parse_or_none(data: bytes) -> ParsedFile:
    try:
        return parse(data)
    except (ValueError, KeyError, IndexError, UnicodeDecodeError):
        return ParsedFile()


def differences(before: bytes, after: bytes) -> list[int]:
    """Offsets of the bytes of ``before`` that are not there in ``after``."""
    shared = min(len(before), len(after))
    found = []
    for begin in range(0, shared, 4096):
        end = min(begin + 4096, shared)
        if before[begin:end] != after[begin:end]:
            found += [at for at in range(begin, end) if before[at] != after[at]]
    return [*found, *range(shared, len(before))]
