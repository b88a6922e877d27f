"""A finished file by the official reader."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from mcap.reader import make_reader

from tests.logger.campaign.mcap_parser import ChannelKey, Content


@dataclass(slots=True)
class OfficialFile:
    """What the official reader gives.  counted : messages by the statistics; fault : why it gives nothing."""

    messages: Counter[Content] = field(default_factory=Counter)
    counted: int = 0
    attachments: list[tuple[str, str, bytes]] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    fault: str | None = None


def read_officially(path: Path) -> OfficialFile:
    """Read a file with every checksum."""
    file = OfficialFile()
    keys: dict[int, ChannelKey] = {}
    try:
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                file.fault = "no summary"
                return file
            file.counted = summary.statistics.message_count
            for schema, channel, message in reader.iter_messages(log_time_order=False):
                if channel.id not in keys:
                    about = (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
                    table = tuple(sorted(channel.metadata.items()))
                    keys[channel.id] = (channel.topic, channel.message_encoding, table, *about)
                key = keys[channel.id]
                times = message.log_time, message.publish_time
                file.messages[Content(key, message.sequence, *times, message.data)] += 1
            file.attachments = [(a.name, a.media_type, a.data) for a in reader.iter_attachments()]
            file.metadata = {m.name: m.metadata for m in reader.iter_metadata()}
    except Exception as error:  # noqa: BLE001  (whatever it is, a reader of others cannot read the file)
        file.fault = f"{type(error).__name__}: {error}"
    return file
