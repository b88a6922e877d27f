"""Copies of a session of which somebody has changed messages, or attachments."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fti.logger.reading.mcap_file import McapFile, McapMessage
from fti.logger.stream_writer import StreamWriter

#: What becomes of a message; None: it is taken out.
Change = Callable[[McapMessage], McapMessage | None]
TRUTH, DERIVED, RAW = "_truth_000.mcap", "_derived_000.mcap", "_000.mcap"


def copy_session(session: Path, out: Path) -> Path:
    """A copy below a folder."""
    return Path(shutil.copytree(session, out / session.name))


def file_of(session: Path, kind: str) -> Path:
    """Its file of a kind."""
    return session / f"{session.name}{kind}"


def rewrite(
    file: Path,
    change: Change = lambda item: item,
    attachments: Mapping[str, bytes | None] | None = None,
    metadata: Mapping[str, dict[str, str] | None] | None = None,
    more: Sequence[tuple[str, int, int]] = (),
) -> None:
    """Write a file anew.

    attachments, metadata : others in place of those of these names; None: without them
    more : empty messages: topic, log time, publish time
    """
    old = file.with_suffix(".old")
    file.rename(old)
    source, channels, writer = McapFile(old), dict[str, int](), StreamWriter(file)
    head = source.head()
    for name, data in {**head.attachments, **(attachments or {})}.items():
        if data is not None:
            writer.add_attachment(name, "text/plain", data, log_time=0)
    for name, table in {**head.metadata, **(metadata or {})}.items():
        if table is not None:
            writer.add_metadata(name, table)
    for item in source.items():
        topic, changed = item.topic.name, change(item)
        if changed is not None:
            if topic not in channels:
                channels[topic] = writer.add_channel(topic, item.topic.encoding, metadata=item.topic.metadata)
            writer.write(
                channels[topic], changed.log_time, changed.data, changed.sequence, publish_time=changed.publish_time
            )
    for topic, log_time, publish_time in more:
        writer.write(writer.add_channel(topic, "json"), log_time, b"{}", publish_time=publish_time)
    writer.close()
    old.unlink()


def with_content(item: McapMessage, **changes: Any) -> McapMessage:
    """A message with other fields."""
    return item._replace(data=json.dumps({**json.loads(item.data), **changes}).encode())
