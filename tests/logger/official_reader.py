"""What the official reader finds in bytes, for the tests of the logger."""

from __future__ import annotations

import struct
from io import BytesIO
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

MessageTuple = tuple[str, int, int, int, bytes]  # topic, log time, publish time, sequence, data


def read_stream(data: bytes) -> list[MessageTuple]:
    """Messages that the official StreamReader gives before the file breaks off."""
    topics: dict[int, str] = {}
    messages: list[MessageTuple] = []
    try:
        for record in StreamReader(BytesIO(data), validate_crcs=True).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                messages.append(_as_message(topics[record.channel_id], record))
    except (McapError, struct.error):
        pass  # the break
    return messages


def read_closed(path: Path) -> list[MessageTuple]:
    """Messages that the official reader gives by the index, checksums validated, in the order of the file."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        messages = [_as_message(c.topic, m) for _, c, m in reader.iter_messages(log_time_order=False)]
        assert summary.statistics is not None
        assert summary.statistics.message_count == len(messages)
        assert sum(summary.statistics.channel_message_counts.values()) == len(messages)
        assert len(list(reader.iter_messages())) == len(messages)  # by the message index
        return messages


def _as_message(topic: str, message: Any) -> MessageTuple:
    return topic, message.log_time, message.publish_time, message.sequence, message.data
