"""What a recovery found, and what is missing."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from fti.logger.reading.summary_index import ChunkLocation
from fti.logger.recovery.recovered_sequence import SequenceGap


@dataclass(slots=True)
class Damage:
    """Bytes begin to end that were not taken, and the times [ns] of what was taken before and after them."""

    begin: int
    end: int
    after_ns: int | None = None
    before_ns: int | None = None


@dataclass(slots=True)
class FileReport:
    """What was found in one file.

    messages : taken; unproved : those among them without a checksum that holds, unproved_ns : log time of the first;
    chunks : taken with their checksum.  altered_metadata : tables that are not as they were written.
    doubts : what the file itself says is unproved or missing, as its writer did not finish it or a recovery made it.
    copies : messages that were taken from another one of joined files already.
    flipped : the bytes of the file in which a bit was turned back, one in each of so many chunks, all of them unproved.
    told_messages, missing_chunks : what the summary, if it was whole, told of besides.
    """

    file: str
    bytes: int
    summary: bool = False
    messages: int = 0
    unproved: int = 0
    unproved_ns: int | None = None
    chunks: int = 0
    attachments: int = 0
    metadata: int = 0
    unreadable_bytes: int = 0
    told_messages: int | None = None
    missing_chunks: list[ChunkLocation] = field(default_factory=list)
    damages: list[Damage] = field(default_factory=list)
    flipped: list[int] = field(default_factory=list)
    altered_metadata: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    copies: int = 0
    #: The summary was whole, and all that it tells of was taken.
    all_told: bool = False

    @property
    def complete(self) -> bool:
        """The summary is whole; nothing is lost, mended, altered or in doubt.

        Indexes, which are made anew, may be damaged.
        """
        return self.summary and not (self.lost or self.flipped or self.altered_metadata or self.doubts)

    @property
    def lost(self) -> bool:
        """Something is missing."""
        return not self.all_told and bool(self.damages or self.missing_messages)

    @property
    def missing_messages(self) -> int | None:
        """Messages missing; None when nothing tells how many there were."""
        return None if self.told_messages is None else max(0, self.told_messages - self.messages - self.copies)


@dataclass(slots=True)
class RecoveryReport:
    """What was found in a session.

    gaps : numbers of frames that are missing between those found; of mode "snapshot" only ``fti verify`` can tell
    """

    source: str
    files: list[FileReport] = field(default_factory=list)
    gaps: list[SequenceGap] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        """Nothing is missing, and nothing was mended."""
        return not self.gaps and all(file.complete for file in self.files)

    def as_json(self) -> dict[str, Any]:
        """The report, for programs."""
        files = [
            {
                **asdict(file),
                "missing_chunks": [chunk._asdict() for chunk in file.missing_chunks],
                "missing_messages": file.missing_messages,
                "complete": file.complete,
            }
            for file in self.files
        ]
        return {
            "source": self.source,
            "complete": self.complete,
            "messages": sum(file.messages for file in self.files),
            "unproved": sum(file.unproved for file in self.files),
            "missing_numbers": [asdict(gap) for gap in self.gaps],
            "files": files,
        }
