"""Navigation again, from the raw bytes of a session: the same chain, the same order, the same outputs bit for bit.

With ``as_flown`` also what the ring lost and where navigation was started again is repeated; without, it is healed.
Equal means: the same range of ``seq``, software, configuration and processor model.
"""

from __future__ import annotations

import json
import tomllib
from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any

from fti import config as configuration
from fti.config import Config
from fti.errors import MissingError, RecordingError
from fti.logger.derived_log import DerivedLog
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.nav.integrity.reference import Reference
from fti.service.binding import BoundDevice, bind_devices, parse_reference, read_texts
from fti.service.chain import Chain, Products
from fti.types import RawFrame

Progress = Callable[[int], None]
FLUSH_FRAMES = 5000


@dataclass(frozen=True, slots=True)
class Setup:
    """A configuration with all that it names."""

    config: Config
    texts: dict[str, str]
    devices: list[BoundDevice]
    reference: Reference | None

    def make_chain(self) -> Chain:
        """A fresh chain."""
        return Chain(self.config, self.devices, self.reference)


@dataclass(frozen=True, slots=True)
class Segment:
    """What one navigation process saw: frames first <= seq <= last (None: to the end) without those in ``lost``."""

    first: int
    last: int | None
    lost: tuple[tuple[int, int], ...] = ()  # (after, before) in order: everything between was not seen

    def holds(self, seq: int) -> bool:
        """Was this frame seen?"""
        inside = seq >= self.first and (self.last is None or seq <= self.last)
        gaps = self.gaps_before(seq)
        return inside and (not gaps or seq >= self.lost[gaps - 1][1])

    def gaps_before(self, seq: int) -> int:
        """How many gaps begin before this frame."""
        return bisect_left(self.lost, seq, key=itemgetter(0))


def recorded_setup(recording: Recording, file: Path) -> Setup:
    """The configuration that the session was recorded with, from its attachments.  Raises RecordingError."""
    texts = {name: data.decode() for name, data in recording.attachments().items()}
    text = texts.pop("config.toml", None)
    if text is None:
        raise RecordingError(f"{file}: holds no configuration; name one")
    return _setup(configuration.parse(tomllib.loads(text), text, file / "config.toml"), texts)


def other_setup(path: str) -> Setup:
    """Another configuration, from its file."""
    config = configuration.load(path)
    return _setup(config, read_texts(config))


def _setup(config: Config, texts: dict[str, str]) -> Setup:
    return Setup(config, texts, bind_devices(config, texts), parse_reference(config, texts))


def flown_segments(recording: Recording) -> list[Segment]:
    """What each navigation process of the flight saw, from the gaps that it noted."""
    segments: list[Segment] = []
    first, lost = 0, list[tuple[int, int]]()
    for note in _gaps(recording):
        if note["kind"] == "restart":
            segments.append(Segment(first, note["after_seq"], tuple(lost)))
            first, lost = note["before_seq"], []
        else:
            lost.append((note["after_seq"], note["before_seq"]))
    return [*segments, Segment(first, None, tuple(lost))]


def _gaps(recording: Recording) -> Iterator[dict[str, Any]]:
    for *_, data in recording.messages("/fti/gap", kind="derived"):
        yield json.loads(data)


def reprocess(recording: Recording, setup: Setup, out: Path, *, as_flown: bool, progress: Progress) -> Path:
    """Run navigation over a recording; returns the new session folder below ``out``.

    progress : called now and then with the number of frames done
    """
    segments = flown_segments(recording) if as_flown else [Segment(0, None)]
    first = next(iter(recording.frames()), None)
    if first is None:
        raise MissingError("the recording holds no frames")
    session = setup.config.session
    texts = {"config.toml": setup.config.text, **setup.texts}
    folder = SessionFolder.create(out, session.name, first.t_rx_ns)
    log = DerivedLog(
        folder,
        split_s=session.split_s,
        split_mb=session.split_mb,
        attachments=[(name, "text/plain", text.encode()) for name, text in texts.items()],
        metadata={"fti": {**recording.metadata.get("fti", {}), "reprocessed": "true"}},
    )
    done = 0
    for segment in segments:
        for frame in _feed(recording.frames(), segment, setup.make_chain(), log):
            done += 1
            if done % FLUSH_FRAMES == 0:
                log.flush()
                progress(frame.seq)
    log.close()
    return folder.path


def _feed(frames: Iterator[RawFrame], segment: Segment, chain: Chain, log: DerivedLog) -> Iterator[RawFrame]:
    passed = 0
    for frame in frames:
        if segment.holds(frame.seq):
            gaps = segment.gaps_before(frame.seq)
            if gaps > passed:
                chain.pass_gap()
                passed = gaps
            _write(chain.feed(frame), log)
            yield frame


def _write(products: Products, log: DerivedLog) -> None:
    for device, measurement in products.measurements:
        log.measurement(device, measurement)
    for note in products.notes:
        log.note(*note)
    for output in products.outputs:
        log.output(output)
