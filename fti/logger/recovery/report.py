"""Report of a recovery: found and missing data."""

from __future__ import annotations

from dataclasses import asdict, astuple, dataclass, field
from typing import Any

from fti.logger.reading.number_ranges import SequenceRange
from fti.logger.reading.summary_index import ChunkLocation


@dataclass(slots=True)
class Damage:
    """Lost bytes begin to end, and the times [ns] of the recovered data before and after them."""

    begin: int
    end: int
    after_ns: int | None = None
    before_ns: int | None = None


@dataclass(slots=True)
class FileReport:
    """Report on one file.

    messages : recovered; unverified : those without a matching checksum, unverified_ns : log time of the first;
    chunks : recovered with a matching checksum.  altered_metadata : tables that do not match their checksums.
    warnings : unverified or missing data according to the metadata of a file that was closed late or recovered before.
    copies : messages that another one of concatenated files has too.
    flipped : the bytes of the file with a corrected bit; their segments are unverified.
    summary_messages, missing_chunks : number of messages, and missing chunks, according to an undamaged summary.
    """

    file: str
    bytes: int
    summary: bool = False
    messages: int = 0
    unverified: int = 0
    unverified_ns: int | None = None
    chunks: int = 0
    attachments: int = 0
    metadata: int = 0
    unreadable_bytes: int = 0
    summary_messages: int | None = None
    missing_chunks: list[ChunkLocation] = field(default_factory=list)
    damages: list[Damage] = field(default_factory=list)
    flipped: list[int] = field(default_factory=list)
    altered_metadata: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    copies: int = 0
    #: The summary is undamaged, and everything in it was recovered.
    matches_summary: bool = False

    @property
    def complete(self) -> bool:
        """Is the summary undamaged and nothing lost, corrected, changed or unverified?

        Indexes may be damaged, because they are rebuilt.
        """
        return self.summary and not (self.lost or self.flipped or self.altered_metadata or self.warnings)

    @property
    def lost(self) -> bool:
        """Is something missing?"""
        return not self.matches_summary and bool(self.damages or self.missing_messages)

    @property
    def missing_messages(self) -> int | None:
        """Number of missing messages; None when it is unknown."""
        return None if self.summary_messages is None else max(0, self.summary_messages - self.messages - self.copies)


@dataclass(slots=True)
class RecoveryReport:
    """Report on a session.

    gaps : missing sequence numbers between the found ones; in mode "snapshot" only ``fti verify`` can find them
    """

    source: str
    files: list[FileReport] = field(default_factory=list)
    gaps: list[SequenceRange] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        """Is nothing missing and nothing corrected?"""
        return not self.gaps and all(file.complete for file in self.files)

    def as_json(self) -> dict[str, Any]:
        """The report, for programs."""
        renamed = {"summary_messages": "told_messages", "matches_summary": "all_told", "warnings": "doubts"}
        renamed |= {"unverified": "unproved", "unverified_ns": "unproved_ns"}
        files = [
            {
                **{renamed.get(key, key): value for key, value in asdict(file).items()},
                "missing_chunks": [chunk._asdict() for chunk in file.missing_chunks],
                "missing_messages": file.missing_messages,
                "complete": file.complete,
            }
            for file in self.files
        ]
        gaps = [dict(zip(("first", "last", "after_ns", "before_ns"), astuple(gap), strict=True)) for gap in self.gaps]
        return {
            "source": self.source,
            "complete": self.complete,
            "messages": sum(file.messages for file in self.files),
            "unproved": sum(file.unverified for file in self.files),
            "missing_numbers": gaps,
            "files": files,
        }
