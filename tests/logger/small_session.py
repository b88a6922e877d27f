"""A small recorder for the tests of verification: it numbers and writes frames, and writes ledgers with its losses."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import Kind, SessionFolder

STARTED = 1_767_323_045_000_000_000
STEP_NS = 10_000_000
LINKS = [RawTopic("ins", "udp", {}), RawTopic("bus", "can", {}), RawTopic("radar", "serial", {})]
#: In turn: received on ins, bus and radar, sent on radar, tick.
TURN = ("/raw/ins", "/raw/bus", "/raw/radar", "/raw/ins", "/tx/radar", "/fti/tick")
ERROR_FRAME = (0x2000_0004).to_bytes(4, "little") + b"\x08\0\0\0" + b"\0\x01" + bytes(6)
Table = dict[str, Any]


class Recorder:
    """One recorder of a session.

    lost    : numbers that a full buffer drops
    held    : numbers that stay in a buffer: they are in no file
    late    : numbers that are written after the next ledger
    removed : numbers that are in no file, and the books do not say so
    socket  : frames of ins that the kernel drops, before the first one
    doctor  : changes a ledger before it is written: (how many were written before, the ledger)
    """

    def __init__(
        self,
        log: RawLog,
        first: int,
        *,
        lost: Iterable[int] = (),
        held: Iterable[int] = (),
        late: Iterable[int] = (),
        removed: Iterable[int] = (),
        socket: int = 0,
        doctor: Callable[[int, Table], None] = lambda index, note: None,
    ) -> None:
        self.log = log
        self.first = self.next = first
        self._lost, self._held, self._late, self._removed = set(lost), set(held), set(late), set(removed)
        self._socket = socket
        self._doctor = doctor
        self._ledgers = 0
        self._waiting: list[int] = []
        self._counts: Counter[tuple[str, str]] = Counter()
        self._identity = {"pid": 1000 + first, "started_ns": time_of(first) - 1, "first_seq": first}
        self._errors = 0

    def run(self, frames: int, ledger_every: int = 50) -> Recorder:
        """So many numbers, with a ledger now and then."""
        for seq in range(self.next, self.next + frames):
            self._frame(seq)
            if seq % ledger_every == ledger_every - 1:
                self.ledger()
            self.log.flush()
        return self

    def _frame(self, seq: int) -> None:
        self.next = seq + 1
        topic, data = TURN[seq % len(TURN)], payload(seq)
        self._add(topic, "in", data)
        self._errors += data == ERROR_FRAME
        if seq in self._late:
            self._waiting.append(seq)
        if seq in self._lost or seq in self._held or seq in self._late:
            self._add(topic, "lost" if seq in self._lost else "held", data)
            return
        self._add(topic, "recorded", data)
        if seq not in self._removed:
            self.write(seq)

    def write(self, seq: int) -> None:
        """Into the file, and not into the books."""
        topic, data = TURN[seq % len(TURN)], payload(seq)
        link = topic.rpartition("/")[2]
        if topic == "/fti/tick":
            self.log.write_tick(seq, time_of(seq))
        elif topic.startswith("/tx/"):
            self.log.write_sent(link, seq, time_of(seq), data)
        else:
            self.log.write_frame(link, seq, time_of(seq), data)

    def _add(self, topic: str, what: str, data: bytes, count: int = 1) -> None:
        self._counts[topic, what + "_frames"] += count
        self._counts[topic, what + "_bytes"] += count * len(data)

    def ledger(self, *, final: bool = False) -> None:
        """The books now; then what waited is written."""
        note = self.note(final=final)
        self._doctor(self._ledgers, note)
        self._ledgers += 1
        self.log.write_json("/fti/ledger", time_of(self.next), note)
        for seq in self._waiting:
            topic, data = TURN[seq % len(TURN)], payload(seq)
            self._add(topic, "held", data, -1)
            self._add(topic, "recorded", data)
            self.write(seq)
        self._waiting = []

    def note(self, *, final: bool = False) -> Table:
        """What a ledger says now."""
        links = {topic.link: self._link(topic.link) for topic in LINKS}
        about = {"t_ns": time_of(self.next), "recorder": dict(self._identity), "next_seq": self.next, "final": final}
        return {**about, "ticks": self._account("/fti/tick"), "links": links}

    def _link(self, name: str) -> Table:
        errors = {"can_error_frames": self._errors, "can_rx_overflow": self._errors} if name == "bus" else {}
        return {**self._account("/raw/" + name), "sent": self._account("/tx/" + name), "errors": errors}

    def _account(self, topic: str) -> Table:
        count = self._counts
        socket = self._socket if topic == "/raw/ins" else 0
        dropped: Table = {}
        if socket:
            dropped["socket_queue"] = {"frames": socket, "bytes": None}
        if lost := count[topic, "lost_frames"]:
            dropped["buffer_overflow"] = {"frames": lost, "bytes": count[topic, "lost_bytes"]}
        parts = ((part, what) for part in ("in", "recorded", "held") for what in ("frames", "bytes"))
        table: Table = {f"{part}_{what}": count[topic, f"{part}_{what}"] for part, what in parts}
        return {**table, "in_frames": table["in_frames"] + socket, "dropped": dropped}

    def end(self) -> None:
        """In good order."""
        self.ledger(final=True)
        self.log.close()

    def kill(self) -> None:
        """The file stays as it is."""
        self.log.flush()
        self.log.segment.abandon()


def payload(seq: int) -> bytes:
    """What the frame with a number holds; one of its lengths in ten is that of an error frame of the bus."""
    topic = TURN[seq % len(TURN)]
    if topic == "/fti/tick":
        return b""
    if topic == "/raw/bus":
        return ERROR_FRAME if seq % 30 == 1 else seq.to_bytes(3, "little") + bytes(13)
    return b"%06d" % seq + bytes(seq % 7)


def time_of(seq: int) -> int:
    """When it came."""
    return STARTED + seq * STEP_NS


def open_log(folder: SessionFolder, kind: Kind = "raw", **keys: Any) -> RawLog:
    """The raw log of a session with short files."""
    about = {"split_s": 2, "split_mb": 100, "metadata": {"fti": {"origin": "hil"}}, **keys}
    settings = LogSettings(attachments=[("config.toml", "text/plain", b"a = 1\n" * 20)], **about)
    return RawLog(folder, LINKS, settings, kind=kind)


def make(folder: SessionFolder, frames: int = 500, **keys: Any) -> SessionFolder:
    """A whole session of one recorder."""
    Recorder(open_log(folder), 0, **keys).run(frames).end()
    return folder
