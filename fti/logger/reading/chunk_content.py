"""Parser of the records of a chunk, up to the first invalid one."""

from __future__ import annotations

import struct
from array import array
from collections.abc import Collection

from fti.logger.reading.record_validation import is_channel, is_schema
from fti.logger.records import HEAD, MESSAGE, MESSAGE_BODY, Op, read_text

_MESSAGE = int(Op.MESSAGE)  # looking up a member of an enumeration is slow in a loop over all messages
_SCHEMA = int(Op.SCHEMA)
_CHANNEL = int(Op.CHANNEL)
_HEAD = HEAD.size
NO_TIME = 2**64 - 1


class Content:
    """Content of a chunk: its bytes, message index, schemas, channels, times and sequence numbers.

    ``index`` : channel -> log time and offset, in turn.  ``numbers`` : channel -> sequence and log time, in turn.
    known : channels that messages may have besides those declared here; None : any.
    """

    def __init__(self, known: Collection[int] | None) -> None:
        self.data = bytearray()
        self.end = 0  # of the valid records
        self.last = 0  # offset of the last valid record
        self.schemas: dict[int, bytes] = {}
        self.channels: dict[int, bytes] = {}
        self.undeclared: set[int] = set()
        self.index: dict[int, array[int]] = {}
        self.numbers: dict[int, array[int]] = {}
        self.times = (NO_TIME, 0)
        self._known = known

    @property
    def messages(self) -> int:
        """Number of messages."""
        return sum(len(entries) for entries in self.index.values()) // 2

    @property
    def whole(self) -> bool:
        """Are all bytes valid records?"""
        return self.end == len(self.data)

    @property
    def torn(self) -> bool:
        """Do the valid records end with nothing or with the begin of one more?"""
        rest = len(self.data) - self.end
        if rest < _HEAD:
            return True
        op, length = HEAD.unpack_from(self.data, self.end)
        return op in (_SCHEMA, _CHANNEL, _MESSAGE) and length > rest - _HEAD

    def feed(self, data: bytes) -> Content:
        """Add bytes; returns itself."""
        self.data += data
        at, size, body = self.end, len(self.data), self.data
        first, last = self.times
        while at + _HEAD <= size:
            op, length = HEAD.unpack_from(body, at)
            end = at + _HEAD + length
            if end > size:
                break
            if op == _MESSAGE:
                if length < MESSAGE_BODY:
                    break
                _, _, channel, sequence, log_time, _ = MESSAGE.unpack_from(body, at)
                entries = self.index.get(channel)
                if entries is None:
                    entries = self._begin(channel)
                    if entries is None:
                        break
                entries.extend((log_time, at))
                self.numbers[channel].extend((sequence, log_time))
                first, last = min(first, log_time), max(last, log_time)
            elif not self._declare(op, bytes(body[at:end])) and not (op >= Op.PADDING and self._known is None):
                break
            self.last, at = at, end
        self.end = at
        self.times = first, last
        return self

    def _begin(self, channel: int) -> array[int] | None:
        """The entries of a channel with its first message in this chunk; None for an unknown channel."""
        if channel not in self.channels:
            if self._known is not None and channel not in self._known:
                return None
            self.undeclared.add(channel)
        self.numbers[channel] = array("Q")
        return self.index.setdefault(channel, array("Q"))

    def _declare(self, op: int, record: bytes) -> bool:
        """Add a schema or a channel; False when the record is neither."""
        try:
            (own_id,) = struct.unpack_from("<H", record, _HEAD)
            if op == _SCHEMA:
                return is_schema(record[_HEAD:]) and self.schemas.setdefault(own_id, record) == record
            return op == _CHANNEL and is_channel(record[_HEAD:]) and self.channels.setdefault(own_id, record) == record
        except (struct.error, UnicodeDecodeError):
            return False

    def cut(self) -> Content:
        """The valid records except the last one: the damage that follows may begin in it."""
        return Content(self._known).feed(bytes(self.data[: self.last]))

    def trim(self) -> Content:
        """Drop the bytes after the valid records; returns itself."""
        del self.data[self.end :]
        return self


def channel_name(record: bytes) -> tuple[str, str, int]:
    """Topic, message encoding and schema of a channel record."""
    _, schema_id = struct.unpack_from("<HH", record, _HEAD)
    topic, at = read_text(record, _HEAD + 4)
    return topic, read_text(record, at)[0], schema_id
