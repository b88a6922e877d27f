"""Parser of the records of a chunk, up to the first invalid one."""

from __future__ import annotations

import struct
from array import array
from collections.abc import Collection

from fti.logger.reading.record_cursor import head_at, record_id, records_in
from fti.logger.reading.record_validation import is_channel, is_schema
from fti.logger.records import HEAD, Op

_MESSAGE = int(Op.MESSAGE)  # looking up a member of an enumeration is slow in a loop over all messages
_SCHEMA = int(Op.SCHEMA)
_CHANNEL = int(Op.CHANNEL)
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
        head = head_at(self.data, self.end)
        rest = len(self.data) - self.end - HEAD.size
        return head is None or (head[0] in (_SCHEMA, _CHANNEL, _MESSAGE) and head[1] > rest)

    def feed(self, data: bytes) -> Content:
        """Add bytes; returns itself."""
        self.data += data
        valid_end = self.end
        first, last = self.times
        for at, end, (op, _, channel, sequence, log_time, _) in records_in(self.data, valid_end):
            if op == _MESSAGE:
                entries = self.index.get(channel) or self._begin(channel)
                if entries is None:
                    break
                entries.extend((log_time, at))
                self.numbers[channel].extend((sequence, log_time))
                first, last = min(first, log_time), max(last, log_time)
            elif not self._declare(op, bytes(self.data[at:end])) and not (op >= Op.PADDING and self._known is None):
                break
            self.last, valid_end = at, end
        self.end = valid_end
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
            own_id, body = record_id(record), record[HEAD.size :]
            if op == _SCHEMA:
                return is_schema(body) and self.schemas.setdefault(own_id, record) == record
            return op == _CHANNEL and is_channel(body) and self.channels.setdefault(own_id, record) == record
        except (struct.error, UnicodeDecodeError):
            return False

    def cut(self) -> Content:
        """The valid records except the last one: the damage that follows may begin in it."""
        return Content(self._known).feed(bytes(self.data[: self.last]))

    def trim(self) -> Content:
        """Drop the bytes after the valid records; returns itself."""
        del self.data[self.end :]
        return self
