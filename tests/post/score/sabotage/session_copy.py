"""Reads a recorded session and writes it again, well-formed, with other content.

Only files with changes are written again, by the writer of the recorder itself: metadata with checksums, attachments,
schemas, channels and summary are as an honest writer makes them.  Files without changes are hard links.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal

from mcap.reader import make_reader

from fti.logger.metadata_checksum import CHECKSUM_KEY, with_checksums
from fti.logger.reading.mcap_file import McapFile, McapMessage
from fti.logger.session import SessionFolder
from fti.logger.stream_writer import StreamWriter

Kind = Literal["raw", "derived", "truth"]
KINDS: tuple[Kind, ...] = ("raw", "derived", "truth")
FILE_METADATA, TRUTH, LATE = "fti.file", "/truth/state", "/truth/late"
SECOND_NS = 1_000_000_000
FLUSH_EVERY = 20_000
#: A row of the truth that is written so long after its instant was written by an emulator that was late [ns].
LATE_NS = 100_000_000


@dataclass(frozen=True)
class Declarations:
    """Schemas (name, encoding, data) and channels of a file in the order of their ids."""

    schemas: tuple[tuple[str, str, bytes], ...]
    channels: tuple[tuple[str, str, int, Mapping[str, str]], ...]


@dataclass
class LogFile:
    """One MCAP file of a session.

    items : its messages in the order of the file; cut_share : only so much of the bytes is written
    """

    path: Path
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    items: list[McapMessage]
    declared: Declarations
    changed: bool = False
    cut_share: float = 1.0

    @classmethod
    def read(cls, path: Path) -> LogFile:
        """All of a file."""
        file = McapFile(path)
        items = list(file.items())
        if file.fault:
            raise ValueError(f"{path}: {file.fault}")
        head = file.head()
        return cls(path, head.metadata, head.attachments, items, _declarations(path))

    def copy(self) -> LogFile:
        """A copy whose content can be replaced without a change of this one."""
        metadata = {name: dict(table) for name, table in self.metadata.items()}
        return LogFile(self.path, metadata, dict(self.attachments), self.items, self.declared)

    def write(self, path: Path) -> None:
        """Write it as a new file."""
        writer = StreamWriter(path)
        tables = {name: _without_sums(name, table) for name, table in self.metadata.items()}
        for name, table in (with_checksums(FILE_METADATA, tables) if FILE_METADATA in tables else tables).items():
            writer.add_metadata(name, table)
        for name, data in self.attachments.items():
            media_type = "application/json" if name.endswith(".json") else "text/plain"
            writer.add_attachment(name, media_type, data, log_time=0)
        for schema in self.declared.schemas:
            writer.add_schema(*schema)
        ids = {channel[0]: writer.add_channel(*channel) for channel in self.declared.channels}
        for number, (topic, log_time, publish_time, sequence, data) in enumerate(self.items):
            writer.write(ids[topic.name], log_time, data, sequence, publish_time)
            if number % FLUSH_EVERY == 0:
                writer.flush()
        writer.close()
        if self.cut_share < 1.0:
            os.truncate(path, round(self.cut_share * path.stat().st_size))


def _link(file: Path, path: Path) -> None:
    """The same file at another place; a copy where that is on another medium."""
    try:
        os.link(file, path)
    except OSError:
        shutil.copyfile(file, path)


def _without_sums(name: str, table: Mapping[str, str]) -> dict[str, str]:
    return {key: text for key, text in table.items() if name != FILE_METADATA or not key.startswith(CHECKSUM_KEY)}


def _declarations(path: Path) -> Declarations:
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    if summary is None:
        raise ValueError(f"{path}: has no summary")
    numbers = {schema_id: number for number, schema_id in enumerate(sorted(summary.schemas), 1)}
    schemas = [summary.schemas[schema_id] for schema_id in sorted(summary.schemas)]
    channels = [summary.channels[channel_id] for channel_id in sorted(summary.channels)]
    return Declarations(
        tuple((schema.name, schema.encoding, schema.data) for schema in schemas),
        tuple((c.topic, c.message_encoding, numbers.get(c.schema_id, 0), c.metadata) for c in channels),
    )


@dataclass
class Session:
    """A recorded session.  folder : of its files; files : of each kind, in order"""

    folder: Path
    files: dict[Kind, list[LogFile]] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path, truth: Path | None = None) -> Session:
        """All files of a folder.  truth : its truth file where that lies elsewhere"""
        places = {kind: SessionFolder(folder).files(kind) for kind in KINDS}
        if truth is not None:
            places["truth"] = [truth]
        return cls(folder, {kind: [LogFile.read(path) for path in paths] for kind, paths in places.items()})

    def copy(self) -> Session:
        """A copy whose content can be replaced without a change of this one."""
        return Session(self.folder, {kind: [file.copy() for file in files] for kind, files in self.files.items()})

    def items(self, kind: Kind) -> Iterator[McapMessage]:
        """The messages of a kind in the order of the files."""
        for file in self.files[kind]:
            yield from file.items

    @cached_property
    def begin_ns(self) -> int:
        """FTI time at which the flight began [ns]."""
        return self._states[0].log_time

    @cached_property
    def end_s(self) -> float:
        """Time of the last row of the truth [s of the flight]."""
        return self.seconds(self._states[-1].log_time)

    def was_late(self, from_s: float, until_s: float) -> bool:
        """Was the emulator late in this interval, by the truth file?  Then flags and outputs may be missing."""
        return any(begin <= until_s and end >= from_s for begin, end in self._late)

    @cached_property
    def _late(self) -> list[tuple[float, float]]:
        """When rows of the truth were due, and when they were written, of those that were written late."""
        return [
            (self.seconds(item.log_time), self.seconds(item.publish_time))
            for item in self.items("truth")
            if item.topic.name in (TRUTH, LATE) and item.publish_time - item.log_time > LATE_NS
        ]

    @cached_property
    def _states(self) -> list[McapMessage]:
        return [item for item in self.items("truth") if item.topic.name == TRUTH]

    def seconds(self, t_ns: int) -> float:
        """Time of the flight [s]."""
        return (t_ns - self.begin_ns) / SECOND_NS

    def ns(self, t_s: float) -> int:
        """FTI time [ns] of a time of the flight."""
        return self.begin_ns + round(t_s * SECOND_NS)

    def topics(self, kind: Kind, prefix: str = "/") -> list[str]:
        """The topics that have messages, sorted."""
        return sorted({item.topic.name for item in self.items(kind) if item.topic.name.startswith(prefix)})

    def replace(self, kind: Kind, edit: Callable[[list[McapMessage]], list[McapMessage]]) -> None:
        """Replace the messages of each file of a kind."""
        for file in self.files[kind]:
            file.items = edit(file.items)
            file.changed = True

    def save(self, folder: Path) -> Path:
        """Write the session into a new folder with the name of the old one; returns that."""
        place = folder / self.folder.name
        place.mkdir(parents=True)
        for kind, files in self.files.items():
            for number, file in enumerate(files):
                path = SessionFolder(place).file_path(kind, number)
                if file.changed:
                    file.write(path)
                else:
                    _link(file.path, path)
        return place
