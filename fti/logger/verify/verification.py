"""Verification of a session: files readable to the end, complete sequence numbers, complete byte accounts.

This program reads the files once, with one chunk and the missing numbers in memory; the official reader reads them
once.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from operator import sub
from pathlib import Path
from typing import IO

from mcap.exceptions import EndOfFile, McapError
from mcap.reader import SeekingReader
from mcap.records import Chunk, ChunkIndex, McapRecord, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from fti.errors import RecordingError
from fti.logger.lock import is_being_written
from fti.logger.reading.compression import decompress
from fti.logger.reading.limits import MAX_GAP_NOTES, MAX_HOLES, check_topic_count
from fti.logger.reading.mcap_file import McapChannel
from fti.logger.reading.record_cursor import check_content
from fti.logger.reading.recording import Recording
from fti.logger.records import MESSAGE_BODY
from fti.logger.session import name_parts
from fti.logger.verify.file_check import FileCheck, MessageRow, Page
from fti.logger.verify.gap_check import GapNotes
from fti.logger.verify.ledger_check import LedgerCheck
from fti.logger.verify.report import Check, CheckResult, TopicTotals, VerifyReport
from fti.logger.verify.sequence_check import SequenceCheck
from fti.logger.verify.session_check import SessionCheck, frames_are_separate
from fti.logger.verify.snapshot_check import SnapshotCheck
from fti.messages.topics import GAP_TOPIC, LEDGER_TOPIC, TICK_TOPIC

#: Receives the processed and the total size [B].
Progress = Callable[[int, int], None]


def verify(recording: Recording, progress: Progress = lambda done, total: None) -> VerifyReport:
    """Read everything and compare.  Raises MissingError when a file cannot be opened."""
    return _Verification(recording, progress).run()


class _Verification:
    def __init__(self, recording: Recording, progress: Progress) -> None:
        self._recording = recording
        self._report = VerifyReport(files=len(recording.files))
        self._numbers = SequenceCheck()
        raw = recording.raw_files
        is_from_start = recording.path.is_dir() or bool(
            raw and name_parts(raw[0])[1] == 0 and raw[0].stem.endswith("_000")
        )
        self._ledger = LedgerCheck(
            self._numbers, is_from_start=is_from_start, frames_are_separate=frames_are_separate(recording)
        )
        self._is_from_start = is_from_start
        self._gaps = GapNotes()
        self._snapshots = SnapshotCheck(self._numbers)
        self._ends: list[str] = []
        self._progress = progress
        self._done = 0
        self._total = 2 * sum(path.stat().st_size for path in recording.files)

    def run(self) -> VerifyReport:
        files = Check("files", "readable to the end, with every checksum and every index entry")
        official = Check("official reader", "finds the same messages")
        for path in self._recording.files:
            self._read(path, files, official)
        report = self._report
        report.checks += [files, official]
        self._ledger.finish()
        report.ledgers = self._ledger.notes
        report.numbered = self._numbers.frames
        SessionCheck(
            self._recording, self._numbers, self._ledger, self._gaps, is_from_start=self._is_from_start
        ).conclude(report)
        if self._recording.raw_files or self._recording.is_snapshot_session:
            report.checks += self._check_snapshots()
        self._check_ends(files)
        return report

    def _check_ends(self, files: Check) -> None:
        """Missing bytes at the end of a raw file are not a loss if the session is verified complete without them.

        Data that a failed medium may have lost were written to the next file too.
        """
        others = (check.result for check in self._report.checks if check is not files)
        complete = not self._report.missing and all(result in (CheckResult.OK, CheckResult.NOTE) for result in others)
        complete = complete and bool(self._ledger.runs) and all(run.last.final for run in self._ledger.runs)
        for text in self._ends:
            files.add(CheckResult.NOTE if complete else CheckResult.LOSS, text)

    # ---------------------------------------------------------------------------------------------------------- files

    def _read(self, path: Path, files: Check, official: Check) -> None:
        file = FileCheck(path)
        raw, snapshot = path in self._recording.raw_files, path in self._recording.snapshot_files
        frames = path in self._recording.frame_files
        if frames:
            self._numbers.begin_file()
        self._snapshots.files += snapshot
        for page in file.pages():
            if raw:
                self._snapshots.add_raw_page(path, page)
            elif snapshot:
                self._snapshots.compare(page)
            self._feed(page, raw=raw, frames=frames)
            self._check_limits(path)
            self._progress(self._done + page.end, self._total)
        size = path.stat().st_size
        self._done += size
        for fault in file.faults:
            files.add(CheckResult.REFUTED, f"{path.name}: {fault}")
        if file.unfinished_fault:
            text = "is being written" if is_being_written(path) else file.unfinished_fault
            files.add(CheckResult.LOSS, f"{path.name}: {text}")
        for warning in file.warnings:
            files.add(CheckResult.LOSS, f"{path.name}: {warning}")
        for warning in file.end_warnings:
            if raw:
                self._ends.append(f"{path.name}: {warning}")
            else:
                files.add(CheckResult.LOSS, f"{path.name}: {warning}")
        for note in file.notes:
            files.add(CheckResult.NOTE, f"{path.name}: {note}")
        for fault in self._read_officially(file):
            official.add(CheckResult.REFUTED, f"{path.name}: {fault}")
        self._done += size

    def _check_limits(self, path: Path) -> None:
        """Check the memory limits of a session.  Raises RecordingError."""
        check_topic_count(len(self._report.topics), path)
        holes = max(MAX_HOLES, self._total // 16)
        if len(self._numbers.coverage.ranges) > holes:
            raise RecordingError(f"{path}: its numbers have more than {holes} holes")
        if len(self._gaps.overflows) > MAX_GAP_NOTES:
            raise RecordingError(f"{path}: has more than {MAX_GAP_NOTES} notes of gaps")

    def _feed(self, page: Page, *, raw: bool, frames: bool) -> None:
        if frames:
            self._numbers.feed(_without_ticks(page) if self._recording.raw_files and not raw else page)
        for channel, rows in page.rows:
            self._count(channel, rows)
            if channel.name == LEDGER_TOPIC and raw:
                for row in rows:
                    self._ledger.feed(row[1], page.body(row))
            elif channel.name == GAP_TOPIC:
                for row in rows:
                    self._gaps.feed(row[1], page.body(row), raw=raw)
        if frames:
            self._ledger.settle()

    def _count(self, channel: McapChannel, rows: list[MessageRow]) -> None:
        topic = self._report.topics.setdefault(channel.name, TopicTotals())
        topic.messages += len(rows)
        topic.bytes += sum([length for _, _, _, length in rows]) - MESSAGE_BODY * len(rows)
        times = [log_time for _, log_time, _, _ in rows]
        longest = max(map(sub, times, [topic.last_ns or times[0], *times]))
        topic.longest_gap_ns = max(topic.longest_gap_ns, longest)
        topic.last_ns = times[-1]

    def _check_snapshots(self) -> list[Check]:
        """Are the copies equal?  No check without snapshots in a continuous recording."""
        found, only = self._snapshots, self._recording.is_snapshot_session
        if not found.files and not only:
            return []
        text = f"{found.files} files with {found.frames} numbered messages; {found.copies} are in raw files too"
        check = Check("snapshots", f"{text}, identical")
        if only:
            check.add(CheckResult.NOTE, "SNAPSHOT: not a continuous recording, only frames around triggers")
        if found.different:
            check.add(CheckResult.REFUTED, f"{found.different} messages differ from the raw files")
        return [check]

    # ------------------------------------------------------------------------------------------------ official reader

    def _read_officially(self, file: FileCheck) -> list[str]:
        try:
            return self._read_by_index(file) if file.finished else self._read_by_stream(file)
        except (McapError, ValueError, LookupError, struct.error, OverflowError, MemoryError, OSError) as error:
            return [str(error) or type(error).__name__]

    def _read_by_index(self, file: FileCheck) -> list[str]:
        """Compare a finished file by its summary, which must match the content."""
        found: Counter[int] = Counter()
        known = set(file.chunks)  # within the limits
        with file.path.open("rb") as stream:
            reader = SeekingReader(stream, validate_crcs=True, record_size_limit=file.path.stat().st_size)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                return ["has no summary"]
            for index in summary.chunk_indexes:
                if index.chunk_start_offset not in known:
                    raise McapError(f"there is no chunk at byte {index.chunk_start_offset}")
                found.update(_channels_of(stream, index))
                self._progress(self._done + stream.tell(), self._total)
        chunks = [index.chunk_start_offset for index in summary.chunk_indexes]
        stated = {channel: count for channel, count in summary.statistics.channel_message_counts.items() if count}
        faults = []
        if found != file.messages:
            faults.append(f"{found.total()} messages, {file.messages.total()} by this program")
        if stated != dict(file.messages) or summary.statistics.message_count != file.messages.total():
            faults.append(f"the summary states {summary.statistics.message_count} messages, the file has others")
        if sorted(chunks) != file.chunks:
            faults.append(f"the summary states {len(chunks)} chunks, the file has others")
        return faults

    def _read_by_stream(self, file: FileCheck) -> list[str]:
        """Compare an unfinished file, which may have grown since.

        The reader accepts whole chunks only: a chunk that is not verified to its end cannot be compared.
        """
        if not file.verified:
            return []
        found, size = 0, file.path.stat().st_size
        with file.path.open("rb") as stream:
            try:
                for record in StreamReader(stream, emit_chunks=True, record_size_limit=size).records:
                    found += _messages_in(record)
            except (EndOfFile, struct.error):
                pass
        known = file.messages.total()
        grown = file.path.stat().st_size > file.size and found > known
        return [] if found == known or grown else [f"{found} messages, {known} by this program"]


def _messages_in(record: McapRecord) -> int:
    """Number of messages of a record.  Raises ValueError for a chunk beyond a limit."""
    if not isinstance(record, Chunk):
        return int(isinstance(record, Message))
    content = decompress(record.compression, record.data, record.uncompressed_size)
    check_content(content, len(record.data))
    return sum(isinstance(inner, Message) for inner in breakup_chunk(record, validate_crc=True))


def _channels_of(stream: IO[bytes], index: ChunkIndex) -> Iterator[int]:
    """The channel of each message of a chunk; the reader's own loop would keep all chunks in memory."""
    stream.seek(index.chunk_start_offset)
    limit = index.chunk_length
    chunk = next(StreamReader(stream, skip_magic=True, emit_chunks=True, record_size_limit=limit).records, None)
    if not isinstance(chunk, Chunk):
        raise McapError(f"there is no chunk at byte {index.chunk_start_offset}")
    return (r.channel_id for r in breakup_chunk(chunk, validate_crc=True) if isinstance(r, Message))


def _without_ticks(page: Page) -> Page:
    """The page without ticks, which are in the raw files too."""
    return replace(page, rows=[(topic, rows) for topic, rows in page.rows if topic.name != TICK_TOPIC])
