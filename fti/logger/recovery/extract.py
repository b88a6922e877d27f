"""Extraction of a damaged recording into a copy, with a report of the missing data."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from fti.errors import StorageError
from fti.logger import records
from fti.logger.file_mode import create_file
from fti.logger.log_layout import CLOSED_METADATA, RECOVERED_METADATA, altered_tables
from fti.logger.metadata_checksum import with_own_checksum
from fti.logger.reading.chunk_content import Content
from fti.logger.reading.integrity_notes import list_end_warnings, list_warnings
from fti.logger.reading.json_message import parse_table
from fti.logger.reading.record_cursor import channel_fields, metadata_table, records_in
from fti.logger.reading.record_validation import valid_record
from fti.logger.reading.recording import Recording
from fti.logger.reading.session_locator import check_session_path
from fti.logger.reading.summary_index import read_summary_index
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MAGIC, MESSAGE, Op, read_text
from fti.logger.recovery.chunk_segments import LostBytes, Messages, OtherRecord
from fti.logger.recovery.concatenated_files import file_begins
from fti.logger.recovery.damage_scan import Walk, unknown_channels
from fti.logger.recovery.recovered_sequence import RecoveredSequence
from fti.logger.recovery.recovered_writer import RecoveredWriter
from fti.logger.recovery.report import Damage, FileReport, RecoveryReport
from fti.logger.regular_file import mcap_files
from fti.logger.session import name_parts
from fti.messages.topics import LEDGER_TOPIC

REPORT = "recovered.json"
Progress = Callable[[int], None]


def session_files(session: Path) -> list[Path]:
    """The MCAP files of a session folder, or the one file.  Raises MissingError."""
    check_session_path(session)
    if session.is_dir():
        return sorted(mcap_files(session), key=lambda path: (*name_parts(path), path.name))
    return [session]


def extract_session(session: Path, out: Path, progress: Progress) -> RecoveryReport:
    """Recover every file of a session into the folder ``out``, which must be empty.

    progress : called with the processed bytes.  Raises MissingError and StorageError.
    """
    paths = session_files(session)
    _create_output_folder(out)
    report = RecoveryReport(str(session))
    done = 0
    numbers = RecoveredSequence()
    for path in paths:
        raw = name_parts(path)[0] == "raw"
        start = done
        report.files += _extract_file(
            path,
            out,
            numbers if raw else RecoveredSequence(),
            lambda at: progress(start + at),  # noqa: B023 - called before the next turn of the loop only
        )
        done += path.stat().st_size
        progress(done)
    if not Recording.open(out).is_snapshot_session:  # its missing numbers are not a loss
        report.gaps = numbers.gaps()
    try:
        with os.fdopen(create_file(out / REPORT), "w") as stream:
            json.dump(report.as_json(), stream, indent=1)
    except OSError as error:
        raise StorageError(f"{out / REPORT}: cannot be written: {error.strerror}") from error
    return report


def _create_output_folder(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise StorageError(f"{out}: is not empty; choose another folder with --out")
    except OSError as error:
        raise StorageError(f"{out}: cannot be created: {error.strerror}") from error


def _extract_file(path: Path, out: Path, numbers: RecoveredSequence, progress: Progress) -> list[FileReport]:
    """Recover one file, or each of the concatenated files in it, to a copy with the suffix ``_part<n>``."""
    with TolerantFile(path) as source:
        begins = file_begins(source)
        ends = [*begins[1:], source.size]
    known = KnownChunks() if len(begins) > 1 else None  # digests of chunks are needed for them only
    found = []
    for n, (begin, end) in enumerate(zip(begins, ends, strict=True), 1):
        copy = out / f"{path.stem}{f'_part{n}' if n > 1 else ''}.mcap"
        if known:
            known.begin_part()
        report = extract_file(path, copy, numbers, lambda at: progress(begin + at), part=(begin, end), known=known)  # noqa: B023
        found.append(report)
    return found


class KnownChunks:
    """Content of the chunks of other parts of a file: messages of concatenated copies count once."""

    def __init__(self) -> None:
        self._others: set[bytes] = set()
        self._own: set[bytes] = set()

    def begin_part(self) -> None:
        """Begin another part."""
        self._others |= self._own
        self._own = set()

    def is_copy(self, content: Content) -> bool:
        """Does another part have a chunk with the same records?"""
        digest = hashlib.blake2b(content.data, digest_size=16).digest()
        self._own.add(digest)
        return digest in self._others


def extract_file(
    path: Path,
    out: Path,
    numbers: RecoveredSequence,
    progress: Progress,
    *,
    part: tuple[int, int | None] = (0, None),
    known: KnownChunks | None = None,
) -> FileReport:
    """Recover one file into a finished one, which gets its name when it is complete.  Never changes the input.

    part : begin and end of one of several concatenated files; known : chunks of the other parts
    Raises MissingError when the input cannot be opened, StorageError when the output cannot be written.
    """
    draft = out.with_name(f".{out.name}.part")
    try:
        with TolerantFile(path, *part) as source, RecoveredWriter(draft, _head(source)) as writer:
            report = _Extraction(source, writer, numbers, progress, known).run()
        report.file = out.name if part[0] else report.file
        draft.rename(out)
    finally:
        draft.unlink(missing_ok=True)
    return report


def _head(source: TolerantFile) -> bytes:
    """Magic and header, with the profile of the input, or our own if the input ends within them."""
    if records.file_head().startswith(source.read(0, source.size)):
        return records.file_head()
    header = valid_record(source, len(MAGIC), source.size)
    if header is None or header.op != Op.HEADER:
        return records.file_head("")
    return records.file_head(read_text(source.read(header.at, header.end - header.at), HEAD.size)[0])


class _Extraction:
    def __init__(
        self,
        source: TolerantFile,
        writer: RecoveredWriter,
        numbers: RecoveredSequence,
        progress: Progress,
        known: KnownChunks | None,
    ) -> None:
        self._source = source
        self._known = known
        self._writer = writer
        self._numbers = numbers
        self._summary_index = read_summary_index(source)
        self._walk = Walk(source, self._summary_index, progress)
        self._report = FileReport(source.path.name, source.size, self._summary_index is not None)
        self._taken_offsets: set[int] = set()  # offsets of the copied chunks, attachments and metadata
        self._last_ns: int | None = None
        self._tables: dict[str, dict[str, str]] = {}
        self._has_final_ledger = False

    def run(self) -> FileReport:
        """Copy every piece."""
        for piece in self._walk.pieces():
            if isinstance(piece, Messages):
                self._take_messages(piece)
            elif isinstance(piece, OtherRecord):
                self._take_other(piece)
            else:
                self._note_lost(piece)
        self._compare()
        self._report.altered_metadata = altered_tables(self._tables)
        for name, table in self._tables.items():
            self._report.warnings += [*list_warnings(name, table), *list_end_warnings(name, table)]
        if CLOSED_METADATA in self._tables and not self._has_final_ledger:
            self._report.warnings.append("was closed later and has no final ledger: not verified to be complete")
        recovered_table = with_own_checksum(RECOVERED_METADATA, self._summary())
        self._writer.metadata(records.metadata(RECOVERED_METADATA, recovered_table))
        self._writer.finish()
        return self._report

    def _take_messages(self, piece: Messages) -> None:
        content, report = piece.content, self._report
        self._taken_offsets.add(piece.begin)
        if not content.messages:
            return
        if self._known and piece.verified and self._known.is_copy(content):
            report.copies += content.messages
            return
        for channel_id in unknown_channels(content, self._writer.channels):
            self._declare(channel_id)
        stored, compression = b"", ""
        if piece.head and piece.head.compression:
            stored = self._source.read(piece.head.begin, piece.head.end - piece.head.begin)
            compression = piece.head.compression
        self._writer.chunk(content, compression, stored)
        self._numbers.add(content, self._writer.channels)
        self._note_ledger(content)
        report.messages += content.messages
        report.chunks += piece.verified
        if not piece.verified:
            report.unverified += content.messages
            report.unverified_ns = min(content.times[0], report.unverified_ns or content.times[0])
        if piece.flipped is not None:
            report.flipped.append(piece.flipped)
        self._note_times(content.times)

    def _declare(self, channel_id: int) -> None:
        """Declare a channel whose record was lost: from the rest of the file, or with a generated name."""
        summary_channels = self._summary_index.channels if self._summary_index else {}
        summary_schemas = self._summary_index.schemas if self._summary_index else {}
        channel = self._walk.declared.channels.get(channel_id) or summary_channels.get(channel_id)
        if channel is None:
            channel = records.channel(channel_id, f"/recovered/channel_{channel_id}", "", 0, {})
        schema_id = channel_fields(channel).schema_id
        schema = self._walk.declared.schemas.get(schema_id) or summary_schemas.get(schema_id)
        self._writer.declare(channel_id, channel, schema)

    def _take_other(self, piece: OtherRecord) -> None:
        record = self._source.read(piece.begin, piece.end - piece.begin)
        if piece.op == Op.ATTACHMENT:
            self._writer.attachment(record)
            self._report.attachments += 1
        elif piece.op == Op.METADATA:
            name, table = metadata_table(record)
            self._tables[name] = table
            self._writer.metadata(record)
            self._report.metadata += 1
        self._taken_offsets.add(piece.begin)

    def _note_ledger(self, content: Content) -> None:
        """Is the last ledger so far the final one of its recorder?"""
        for channel_id, entries in content.index.items():
            record = self._writer.channels.get(channel_id)
            if record and channel_fields(record).topic == LEDGER_TOPIC:
                _, end, _ = next(records_in(content.data, entries[-1]))
                self._has_final_ledger = False
                with suppress(ValueError):
                    table = parse_table(bytes(content.data[entries[-1] + MESSAGE.size : end]))
                    self._has_final_ledger = table.get("final") is True

    def _note_times(self, times: tuple[int, int]) -> None:
        for damage in reversed(self._report.damages):
            if damage.before_ns is not None:
                break
            damage.before_ns = times[0]
        self._last_ns = max(times[1], self._last_ns or 0)

    def _note_lost(self, piece: LostBytes) -> None:
        damages = self._report.damages
        if damages and damages[-1].end == piece.begin:
            damages[-1].end = piece.end
        else:
            damages.append(Damage(piece.begin, piece.end, self._last_ns))

    def _compare(self) -> None:
        report, summary = self._report, self._summary_index
        report.unreadable_bytes = self._source.unreadable
        if summary:
            taken = self._taken_offsets | {offset + summary.shift for offset in self._taken_offsets}
            report.summary_messages = summary.messages
            report.missing_chunks = [chunk for chunk in summary.chunks if chunk.offset not in taken]
            others_taken = all(offset in taken for offset in summary.others)
            counted = summary.messages is not None and bool(summary.others or summary.chunks or not summary.messages)
            complete = not report.missing_chunks and others_taken and report.missing_messages == 0
            report.matches_summary = counted and complete

    def _summary(self) -> dict[str, str]:
        report = self._report
        return {
            "file": report.file,
            "messages": str(report.messages),
            "unproved": str(report.unverified),
            "complete": str(report.complete).lower(),
            "missing_messages": "unknown" if report.missing_messages is None else str(report.missing_messages),
            "damages": json.dumps([asdict(damage) for damage in report.damages]),
            "flipped": json.dumps(report.flipped),
            "altered_metadata": json.dumps(report.altered_metadata),
        }
