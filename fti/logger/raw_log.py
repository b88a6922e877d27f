"""Writer of the raw files: received and sent frames of every link, ticks, clocks, ledger, health and events."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fti.frame_batch import single_frame_batch
from fti.logger import schemas
from fti.logger.log_layout import LogLayout, LogSettings
from fti.logger.note_changes import ENTRY_TABLES, NoteChanges
from fti.logger.session import Kind, Numbering, SessionFolder
from fti.logger.split_log import SplitLog
from fti.messages.topics import TICK_TOPIC

RAW_ENCODING = "x-fti-raw"
LINKS_METADATA = "fti.links"


@dataclass(frozen=True, slots=True)
class RawTopic:
    """A link: its name, kind (serial, udp, can) and settings, for the channel metadata."""

    link: str
    kind: str
    settings: Mapping[str, str]


class RawLog(SplitLog):
    """Writes the raw files of a session.  ``write_batches`` and ``write_json`` only buffer; ``flush`` writes.

    folder : see SplitLog; numbering : see LogLayout
    MCAP sequence is the low 32 bits of seq; log time and publish time are the time of arrival.
    """

    def __init__(
        self,
        folder: SessionFolder | None,
        links: Sequence[RawTopic],
        settings: LogSettings,
        *,
        numbering: Numbering | None = None,
        kind: Kind = "raw",
    ) -> None:
        metadata = {**settings.metadata, LINKS_METADATA: {topic.link: topic.kind for topic in links}}
        super().__init__(folder, LogLayout(kind, replace(settings, metadata=metadata), numbering))
        self._received_channels = {topic.link: self._add_link("/raw/", topic) for topic in links}
        self._sent_channels = {topic.link: self._add_link("/tx/", topic) for topic in links}
        self.tick_channel = self.add_channel(TICK_TOPIC, RAW_ENCODING)
        self._notes: dict[str, int] = {}
        self._changes = {topic: NoteChanges(topic) for topic in ENTRY_TABLES}

    def _add_link(self, prefix: str, topic: RawTopic) -> int:
        channel_metadata = {"link": topic.link, "kind": topic.kind, **topic.settings}
        return self.add_channel(prefix + topic.link, RAW_ENCODING, None, channel_metadata)

    def channels(self, link: str) -> tuple[int, int]:
        """The channels of received and of sent frames of a link; both share one numbering."""
        return self._received_channels[link], self._sent_channels[link]

    def write_frame(self, link: str, seq: int, t_rx_ns: int, data: bytes) -> None:
        """Write a received frame."""
        self.write_batches([(self._received_channels[link], (single_frame_batch(seq, t_rx_ns, data),))])

    def write_sent(self, link: str, seq: int, t_ns: int, data: bytes) -> None:
        """Write sent bytes."""
        self.write_batches([(self._sent_channels[link], (single_frame_batch(seq, t_ns, data),))])

    def write_tick(self, seq: int, t_ns: int) -> None:
        """Write a tick frame."""
        self.write_batches([(self.tick_channel, (single_frame_batch(seq, t_ns, b""),))])

    def write_json(self, topic: str, t_ns: int, obj: Any) -> None:
        """Write a note on ``/fti/clock``, ``/fti/ledger``, ``/fti/health``, ``/fti/event`` or ``/fti/gap``.

        obj : a table, or for ``/fti/event`` an Event.  Of health and ledger the changes are recorded, see
        ``fti.logger.note_changes``.  Raises ValueError for another topic.
        """
        channel = self._notes.get(topic)
        if channel is None:
            channel = self._notes[topic] = self.add_channel(topic, "json", schemas.note_schema(topic))
        changes = self._changes.get(topic)
        if changes is None:
            self.write(channel, t_ns, schemas.encode_note(topic, obj))
            return
        file = self.segment.writer
        record = changes.record_of(file, t_ns, obj)
        self.write(channel, t_ns, schemas.encode_note(topic, record))
        changes.mark_recorded(file, t_ns, record)
