"""Common properties of the files of a log: kind, numbering, file head, channels and split limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fti.constants import SECOND_NS
from fti.logger.metadata_checksum import all_changed_tables, with_checksums
from fti.logger.schemas import Schema
from fti.logger.session import Kind, Numbering
from fti.logger.storage_target import MEGABYTE
from fti.logger.stream_writer import StreamWriter

#: Name, media type, content.
Attachment = tuple[str, str, bytes]
Metadata = Mapping[str, Mapping[str, str]]
#: Metadata of each file: kind, session; ``place_0``, ``place_1``: the folders of the storage targets;
#: ``given_up_numbers``: smaller file numbers, separated by spaces, that were allocated but whose file had not been
#: written to when this file began, for example because a medium did not open it in time.
FILE_METADATA = "fti.file"
STORAGE_TARGET_KEY = "place_"
SKIPPED_NUMBERS_KEY = "given_up_numbers"
#: Metadata of a file that was recovered from a damaged one.
RECOVERED_METADATA = "fti.recovered"
#: Metadata of a file that its writer did not finish and that was closed later.
CLOSED_METADATA = "fti.closed"


def altered_tables(tables: Metadata) -> list[str]:
    """Names of the metadata tables of a file that do not match their checksums."""
    return all_changed_tables(FILE_METADATA, tables, (CLOSED_METADATA, RECOVERED_METADATA))


@dataclass(frozen=True, slots=True, kw_only=True)
class LogSettings:
    """Settings of the files of a session, which are readable alone.

    split_s, split_mb     : time span of the messages [s] and size [MiB] at which the next file begins
    attachments, metadata : content of every file
    folders               : all folders that may hold files of the session; every file lists them
    """

    split_s: float
    split_mb: float
    attachments: Sequence[Attachment] = ()
    metadata: Metadata = field(default_factory=dict)
    folders: Sequence[Path] = ()


class LogLayout:
    """Layout of the files of one kind of a session.

    numbering : of the files, shared with other users of the same numbers
    """

    def __init__(self, kind: Kind, settings: LogSettings, numbering: Numbering | None = None) -> None:
        self.kind = kind
        self.numbering = numbering or Numbering()
        self.split_ns = round(settings.split_s * SECOND_NS)
        self.split_bytes = round(settings.split_mb * MEGABYTE)
        self._attachments = settings.attachments
        self._metadata = settings.metadata
        self._folders = {f"{STORAGE_TARGET_KEY}{n}": str(path) for n, path in enumerate(settings.folders)}
        self._schemas: dict[str, tuple[int, Schema]] = {}
        self._channels: list[tuple[str, str, int, Mapping[str, str]]] = []

    def is_full(self, writer: StreamWriter) -> bool:
        """Has the file reached a split limit?"""
        return writer.span_ns >= self.split_ns or writer.bytes_written >= self.split_bytes

    def write_head(self, writer: StreamWriter, session: str, number: int) -> None:
        """Write metadata and attachments: the file is readable alone.  number : of this file.  Raises StorageError."""
        file_table = {"kind": self.kind, "session": session, **self._folders}
        if skipped_numbers := self.numbering.unconfirmed_before(number):
            file_table[SKIPPED_NUMBERS_KEY] = " ".join(map(str, skipped_numbers))
        for name, table in with_checksums(FILE_METADATA, {FILE_METADATA: file_table, **self._metadata}).items():
            writer.add_metadata(name, table)
        for name, media_type, data in self._attachments:
            writer.add_attachment(name, media_type, data, log_time=0)

    def declare(self, writer: StreamWriter) -> None:
        """Declare schemas and channels in a file; the ids are the same in all files."""
        for _, schema in self._schemas.values():
            writer.add_schema(schema.name, schema.encoding, schema.data)
        for channel in self._channels:
            writer.add_channel(*channel)

    def add_channel(
        self,
        writer: StreamWriter | None,
        topic: str,
        encoding: str,
        schema: Schema | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> int:
        """Declare a channel in the open file and all later ones; returns its id, counted from 1."""
        schema_id = 0
        if schema and schema.name not in self._schemas:
            self._schemas[schema.name] = len(self._schemas) + 1, schema
            if writer:
                writer.add_schema(schema.name, schema.encoding, schema.data)
        if schema:
            schema_id, _ = self._schemas[schema.name]
        self._channels.append((topic, encoding, schema_id, metadata or {}))
        if writer:
            writer.add_channel(*self._channels[-1])
        return len(self._channels)
