"""Limits of recorded sessions: a foreign file cannot allocate more memory than these.

Each limit is far above the values of the recorder.  Reading stops at a limit, and the fault of the file reports it.
A small compressed file can claim a very large content.  Therefore the limits of a chunk grow with its bytes in the
file: after a stall the recorder writes the content of all its buffers as one chunk.
"""

from __future__ import annotations

from pathlib import Path

from fti.errors import RecordingError

_MIB = 2**20
#: A record in the file [B].  All buffers of 200 links, full after a stall, are one chunk of 200 MB.
MAX_RECORD = 256 * _MIB
#: An attachment [B], and all attachments together: a configuration and the files that it names are few MB.
MAX_ATTACHMENTS = 64 * _MIB
#: Records other than chunks and attachments [B]: a message index has 16 B for each message of a channel in a chunk.
MAX_SMALL_RECORD = 16 * _MIB
#: Unpacked size of a compressed chunk [B], or MAX_EXPANSION times its bytes: the recorder ends a chunk at 4 MiB.
MAX_UNPACKED = 64 * _MIB
#: zstd compresses recorded bytes by 2 to 20; messages of a chunk above MAX_UNPACKED have some noise.
MAX_EXPANSION = 64
#: Messages of a chunk, or one for each of its bytes in the file: 4 MiB hold 135 300 without content.
MAX_CHUNK_MESSAGES = 2**19
#: Topics of a file, and of a session: a link has two, a device some ten, the service ten.
MAX_TOPICS = 4096
#: A topic [characters]: ``/<device>/<measurement>`` has some 40.
MAX_TOPIC_LENGTH = 1024
#: All channel records of a file together [B]: one has some 200.
MAX_CHANNEL_BYTES = 4 * _MIB
#: All schemas of a file together [B]: the recorder's have 0.3 to 6 kB, and it has some 60.
MAX_SCHEMA_BYTES = 64 * _MIB
#: Metadata of a file, all tables together [B]: the recorder's have 2 kB.
MAX_METADATA_BYTES = 4 * _MIB
#: A message that is JSON [B]: health of 200 links has 200 kB.
MAX_JSON_BYTES = 4 * _MIB
#: Nesting depth of JSON: the recorder's is 6.
MAX_JSON_DEPTH = 64
#: Digits of an integer in JSON: the recorder's have 64 bits, 20 digits; 40 digits still fit a float.
MAX_DIGITS = 40
#: A text of an event that is kept [characters]: the recorder's have some 200.
MAX_TEXT_LENGTH = 10_000
#: FTI time is below this [ns]: the year 2262.
MAX_TIME_NS = 2**63 - 1
#: Ranges of missing numbers, or one for each 8 B of the files: a frame of at least 31 B follows each.
MAX_HOLES = 2**19
#: Notes of gaps: one for each run of dropped frames.
MAX_GAP_NOTES = 2**17
#: Columns of all tables of an export: health of 200 links has 5000.
MAX_COLUMNS = 2**17


class LimitError(ValueError):
    """A file exceeds a limit; the message names the limit, not the file."""


def check_unpacked(size: int, stored: int) -> None:
    """Check the unpacked and stored size of a compressed chunk [B].  Raises LimitError."""
    allowed = max(MAX_UNPACKED, MAX_EXPANSION * stored)
    if size > allowed:
        raise LimitError(f"a chunk of {stored} bytes unpacks to {size}; at most {allowed} are read")


def check_messages(messages: int, stored: int) -> None:
    """Check the number of messages of a chunk with ``stored`` bytes in the file.  Raises LimitError."""
    allowed = max(MAX_CHUNK_MESSAGES, stored)
    if messages > allowed:
        raise LimitError(f"a chunk of {stored} bytes has more than {allowed} messages")


def check_topic(name: str) -> None:
    """Check the name of a topic.  Raises LimitError."""
    if len(name) > MAX_TOPIC_LENGTH:
        raise LimitError(f"a topic has {len(name)} characters; at most {MAX_TOPIC_LENGTH} are read: {name[:40]!r}...")
    if "\0" in name:
        raise LimitError(f"the topic {name[:80]!r} has a NUL in it")


def check_topic_count(count: int, path: Path) -> None:
    """Check the number of topics of a session.  Raises RecordingError."""
    if count > MAX_TOPICS:
        raise RecordingError(f"{path}: has more than {MAX_TOPICS} topics")


class DeclaredSizes:
    """Total sizes of the channels, schemas, metadata and attachments of a file.  All methods raise LimitError."""

    def __init__(self) -> None:
        self._channels: dict[int, int] = {}
        self._schemas: dict[int, int] = {}
        self._metadata = self._attachments = 0
        self._channel_bytes = self._schema_bytes = 0

    def channel(self, channel_id: int, topic: str, size: int) -> None:
        """Add a channel record [B]; the same one may be in each chunk."""
        check_topic(topic)
        self._channel_bytes += size - self._channels.get(channel_id, 0)
        self._channels[channel_id] = size
        if len(self._channels) > MAX_TOPICS:
            raise LimitError(f"it has more than {MAX_TOPICS} topics")
        if self._channel_bytes > MAX_CHANNEL_BYTES:
            raise LimitError(f"its channel records have more than {MAX_CHANNEL_BYTES} bytes together")

    def schema(self, schema_id: int, size: int) -> None:
        """Add a schema record [B]; the same one may be in each chunk."""
        self._schema_bytes += size - self._schemas.get(schema_id, 0)
        self._schemas[schema_id] = size
        if self._schema_bytes > MAX_SCHEMA_BYTES:
            raise LimitError(f"its schemas have more than {MAX_SCHEMA_BYTES} bytes together")

    def metadata(self, size: int) -> None:
        """Add a metadata record [B]."""
        self._metadata += size
        if self._metadata > MAX_METADATA_BYTES:
            raise LimitError(f"its metadata have more than {MAX_METADATA_BYTES} bytes together")

    def attachment(self, size: int) -> None:
        """Add an attachment record [B]."""
        self._attachments += size
        if self._attachments > MAX_ATTACHMENTS:
            raise LimitError(f"its attachments have more than {MAX_ATTACHMENTS} bytes together")
