"""Summary of an MCAP file, collected while it is written or repaired, and written at its end."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Mapping

from fti.logger import records
from fti.logger.records import Op


class Summary:
    """Collects schemas, channels, indexes and counts of one MCAP file."""

    def __init__(self) -> None:
        self.schemas: dict[int, bytes] = {}
        self.channels: dict[int, bytes] = {}
        self.counts: Counter[int] = Counter()
        self.first_ns: int | None = None
        self.last_ns = 0
        self._chunks: list[bytes] = []
        self._attachments: list[bytes] = []
        self._metadata: list[bytes] = []

    def chunk_tail(self, end: int, index: Mapping[int, array[int]]) -> tuple[bytes, dict[int, int]]:
        """Message index records that follow a chunk ending at ``end``, and their offsets."""
        tail, offsets = [], {}
        for channel_id, entries in index.items():
            offsets[channel_id] = end
            tail.append(records.message_index(channel_id, entries.tobytes()))
            end += len(tail[-1])
        return b"".join(tail), offsets

    def add_chunk(
        self,
        offset: int,
        size: int,
        times: tuple[int, int],
        index: Mapping[int, array[int]],
        offsets: dict[int, int],
        *,
        packed: tuple[str, int] = ("", 0),
    ) -> None:
        """Add a finished chunk: its offset, the size of its records, its first and last log time, its message index.

        packed : compression and stored bytes of a compressed chunk.
        """
        length = sum(15 + 8 * len(entries) for entries in index.values())
        self._chunks.append(records.chunk_index(times, offset, size, offsets, length, packed=packed))
        for channel_id, entries in index.items():
            self.counts[channel_id] += len(entries) // 2
        self.first_ns = times[0] if self.first_ns is None else min(self.first_ns, times[0])
        self.last_ns = max(self.last_ns, times[1])

    def add_attachment(self, location: tuple[int, int], log_time: int, size: int, name: str, media_type: str) -> None:
        """Add an attachment of ``size`` bytes; location : offset and length of its record."""
        self._attachments.append(records.attachment_index(location, log_time, size, name, media_type))

    def add_metadata(self, offset: int, length: int, name: str) -> None:
        """Add a metadata record."""
        self._metadata.append(records.metadata_index(offset, length, name))

    def tail(self, offset: int) -> bytes:
        """Everything after the data section, which ends at ``offset``."""
        counts = {channel_id: self.counts[channel_id] for channel_id in self.channels}
        sizes = (len(self.schemas), len(self._attachments), len(self._metadata), len(self._chunks))
        statistics = records.statistics(sizes, (self.first_ns or 0, self.last_ns), counts)
        groups = (
            (Op.SCHEMA, [self.schemas[key] for key in sorted(self.schemas)]),
            (Op.CHANNEL, [self.channels[key] for key in sorted(self.channels)]),
            (Op.STATISTICS, [statistics]),
            (Op.CHUNK_INDEX, self._chunks),
            (Op.ATTACHMENT_INDEX, self._attachments),
            (Op.METADATA_INDEX, self._metadata),
        )
        return records.end_of_file(offset, groups)
