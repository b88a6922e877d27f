"""Detection of the final ledger of a recorder at the end of a file."""

from __future__ import annotations

from collections.abc import Mapping

from fti.logger.reading.chunk_content import Content, channel_name
from fti.logger.reading.json_message import parse_table
from fti.logger.records import HEAD, MESSAGE
from fti.messages.topics import LEDGER_TOPIC


class FinalLedger:
    """Reads the ledgers of a file by chunk.  is_there : the last one so far is final"""

    def __init__(self) -> None:
        self.is_there = False

    def add(self, content: Content, channels: Mapping[int, bytes]) -> None:
        """Add the messages of a chunk; channels : all known ones."""
        for channel_id, entries in content.index.items():
            record = channels.get(channel_id)
            if record and channel_name(record)[0] == LEDGER_TOPIC:
                self.is_there = _is_final(content, entries[-1])


def _is_final(content: Content, at: int) -> bool:
    """Is the ledger at an offset final?"""
    _, length = HEAD.unpack_from(content.data, at)
    try:
        return parse_table(bytes(content.data[at + MESSAGE.size : at + HEAD.size + length])).get("final") is True
    except ValueError:
        return False
