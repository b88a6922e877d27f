"""Run navigation again over the raw bytes of a session: the same chain and order, the same outputs bit for bit.

With ``as_flown`` frames that the ring lost, and restarts of navigation, are repeated; without, navigation gets all
frames.  The terrain, or each square of it, is set at the same frame as in flight; with another configuration the whole
at the first frame, squares where they are needed.
The outputs are equal for the same range of ``seq``, software, configuration and processor model.
"""

from __future__ import annotations

import contextlib
import gc
import itertools
import math
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fti import config as configuration
from fti.config import Config, TerrainFiles, position_sources
from fti.devices import BoundDevice, bind_devices, parse_reference, read_texts
from fti.errors import MissingError, RecordingError
from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.logger.reading.json_message import parse_table, using_message, whole_number
from fti.logger.reading.recording import Recording
from fti.logger.session import CONFIG_ATTACHMENT, SessionFolder
from fti.messages.frames import ALL_SOURCES, RawFrame
from fti.messages.refusals import CarriedRefusal
from fti.messages.tables import from_table
from fti.messages.topics import GAP_TOPIC, READMISSION_TOPIC, TERRAIN_TOPIC
from fti.nav.integrity.reference import ApproachReference
from fti.nav.terrain_reference import Ground
from fti.service.navigation.decode_chain import Chain, ChainOutput
from fti.service.navigation.terrain_areas import TerrainAreas, wanted_areas
from fti.service.navigation.terrain_loader import load_terrain
from fti.terrain.area import TerrainArea

if TYPE_CHECKING:
    from fti.nav.terrain_methods import TerrainObserver

Progress = Callable[[int], None]
FLUSH_FRAMES = 5000
#: Threshold of the cyclic garbage collector [new objects].
GC_THRESHOLD = 100_000


@dataclass(frozen=True, slots=True)
class TerrainNote:
    """After frame ``after_seq`` the terrain was loaded, or loading it had failed (``fault``).

    area : the square that was loaded; None: all
    """

    after_seq: int
    t_ns: int
    sha256: str | None = None
    checksums: tuple[float, ...] | None = None
    fault: str | None = None
    area: TerrainArea | None = None

    def is_of(self, ground: Ground, settings: TerrainFiles) -> bool:
        """Whether this is the terrain of the flight.  Without checksums a scene is identified by its name."""
        if self.checksums is not None:
            return ground.has_checksums(self.checksums)
        return settings.scene is not None or self.sha256 in (None, ground.digest)


@dataclass(frozen=True, slots=True)
class Readmission:
    """After frame ``after_seq`` the operator readmitted a source."""

    after_seq: int
    t_ns: int
    source: str


@dataclass(frozen=True, slots=True)
class Setup:
    """A configuration with the files that it names.

    terrain_notes : when the terrain was loaded in flight
    readmissions : sources that the operator readmitted in flight, in order
    recorded : the configuration is that of the recording; ``fti.terrain`` restricts its elevation files
    """

    config: Config
    texts: dict[str, str]
    devices: list[BoundDevice]
    reference: ApproachReference | None
    terrain_notes: tuple[TerrainNote, ...] = ()
    recorded: bool = False
    readmissions: tuple[Readmission, ...] = ()

    def make_chain(self, observer: TerrainObserver | None = None) -> Chain:
        """A fresh chain."""
        return Chain(self.config, self.devices, self.reference, observer)

    def terrain_notes_of(self, segment: NavigationRun) -> list[TerrainNote]:
        """When a terrain is set in a segment: never where none is configured, or none was loaded in time."""
        settings = self.config.nav.terrain
        if settings is None:
            return []
        if not self.terrain_notes:
            return [TerrainNote(segment.first - 1, 0)] if settings.memory_mb is None else []
        last = math.inf if segment.last is None else segment.last
        notes = [note for note in self.terrain_notes if segment.first - 1 <= note.after_seq <= last]
        return notes if settings.memory_mb is not None else notes[:1]

    @property
    def areas(self) -> TerrainAreas | None:
        """Choose the squares of the terrain: the configuration has them, and the recording has none."""
        settings = self.config.nav.terrain
        if settings is None or settings.memory_mb is None or self.terrain_notes:
            return None
        return TerrainAreas(settings, local_only=self.recorded)

    def readmissions_in(self, segment: NavigationRun) -> list[Readmission]:
        """The readmissions in a segment whose source is in this configuration."""
        sources = {ALL_SOURCES, *position_sources(self.config.nav)}
        last = math.inf if segment.last is None else segment.last
        return [r for r in self.readmissions if segment.first - 1 <= r.after_seq <= last and r.source in sources]

    def load_terrain(self) -> Ground | None:
        """The whole terrain, if navigation had one; None also where it had squares.

        Raises ConfigError or MissingError where it cannot be loaded now, RecordingError where it has changed.
        """
        settings = self.config.nav.terrain
        if settings is None or settings.memory_mb is not None:
            return None
        if self.terrain_notes and all(note.fault for note in self.terrain_notes):
            return None
        ground = load_terrain(settings, local_only=self.recorded)
        for note in self.terrain_notes:
            self._check(ground, note)
        return ground

    def load_area(self, note: TerrainNote) -> Ground | None:
        """The square of a note; None without.  Raises as ``load_terrain``."""
        settings = self.config.nav.terrain
        if settings is None or note.area is None:
            return None
        ground = load_terrain(settings, local_only=self.recorded, area=note.area)
        self._check(ground, note)
        return ground

    def _check(self, ground: Ground, note: TerrainNote) -> None:
        settings = self.config.nav.terrain
        if settings is not None and not note.fault and not note.is_of(ground, settings):
            raise RecordingError(
                f"{ground.name}: is not the terrain of the flight (SHA-256 {note.sha256}); name a configuration "
                "with the terrain to use"
            )


class Restored(NamedTuple):
    """Refusals with which a navigation process begins, and when [ns]."""

    t_ns: int = 0
    refusals: tuple[CarriedRefusal, ...] = ()


NOTHING_RESTORED = Restored()


@dataclass(frozen=True, slots=True)
class NavigationRun:
    """Frames of one navigation process: first <= seq <= last (None: to the end) without those in ``lost``.

    restored : refusals that it took over from the process before, and when [ns]
    """

    first: int
    last: int | None
    lost: tuple[tuple[int, int], ...] = ()  # (after, before) in order: the frames between were missed
    restored: Restored = NOTHING_RESTORED

    def contains(self, seq: int) -> bool:
        """Did the process get this frame?"""
        if seq < self.first or (self.last is not None and seq > self.last):
            return False
        gaps = self.gaps_before(seq) if self.lost else 0
        return not gaps or seq >= self.lost[gaps - 1][1]

    def gaps_before(self, seq: int) -> int:
        """Number of gaps that begin before this frame."""
        return bisect_left(self.lost, seq, key=itemgetter(0))


def recorded_setup(recording: Recording, file: Path) -> Setup:
    """The configuration that the session was recorded with, from its attachments.  Raises RecordingError."""
    config, texts = attached_config(recording.attachments(), file)
    setup = _setup(config, texts)
    files: list[str] = []
    terrain_notes: list[TerrainNote] = []
    for topic, t_ns, _, _, data in recording.messages(TERRAIN_TOPIC, kind="derived"):
        with using_message(topic, t_ns):
            note = parse_table(data)
            files += map(_text, note.get("files", ()))
            terrain_notes.append(_terrain_note(note))
    config = _with_files(setup.config, tuple(files))
    return replace(
        setup,
        config=config,
        terrain_notes=tuple(terrain_notes),
        recorded=True,
        readmissions=tuple(_readmissions(recording)),
    )


def _readmissions(recording: Recording) -> Iterator[Readmission]:
    for topic, t_ns, _, _, data in recording.messages(READMISSION_TOPIC, kind="derived"):
        with using_message(topic, t_ns):
            note = parse_table(data)
            readmission = Readmission(
                whole_number(note["after_seq"]), whole_number(note["t_ns"]), _text(note["source"])
            )
        yield readmission


def attached_config(attachments: Mapping[str, bytes], file: Path) -> tuple[Config, dict[str, str]]:
    """A configuration and the texts of its files, from the attachments of a file.

    Raises RecordingError where there is none, ConfigError where it is invalid.
    """
    texts = {name: configuration.decode_text(data, f"{file / name}") for name, data in attachments.items()}
    text = texts.pop(CONFIG_ATTACHMENT, None)
    if text is None:
        raise RecordingError(f"{file}: contains no configuration; name one")
    place = file / CONFIG_ATTACHMENT
    return configuration.parse(configuration.parse_toml(text, str(place)), text, place), texts


def _terrain_note(note: dict[str, Any]) -> TerrainNote:
    """Raises KeyError or ValueError."""
    sha256, fault = (None if note.get(key) is None else _text(note[key]) for key in ("sha256", "fault"))
    checksums = None if note.get("checksums") is None else tuple(float(number) for number in note["checksums"])
    area = None
    if note.get("radius") is not None:
        lat, lon, radius_m = (float(note[key]) for key in ("lat", "lon", "radius"))
        area = TerrainArea(lat, lon, radius_m, tuple(map(_text, note["files"])))
    return TerrainNote(whole_number(note["after_seq"]), whole_number(note["t_ns"]), sha256, checksums, fault, area)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{str(value)[:40]!r} is not a text")
    return value


def _with_files(config: Config, files: tuple[str, ...]) -> Config:
    """The same configuration with the paths of the elevation files in flight."""
    terrain = config.nav.terrain
    if terrain is None or not files:
        return config
    terrain = terrain.model_copy(update={"files": tuple(dict.fromkeys(files))})
    return config.model_copy(update={"nav": config.nav.model_copy(update={"terrain": terrain})})


def other_setup(path: str) -> Setup:
    """Another configuration, from its file."""
    config = configuration.load(path)
    return _setup(config, read_texts(config))


def _setup(config: Config, texts: dict[str, str]) -> Setup:
    return Setup(config, texts, bind_devices(config, texts), parse_reference(config, texts))


def read_navigation_runs(recording: Recording) -> list[NavigationRun]:
    """The frames of each navigation process of the flight, from its recorded gaps."""
    segments: list[NavigationRun] = []
    first, lost, restored = 0, list[tuple[int, int]](), NOTHING_RESTORED
    for kind, after, before, began in _gaps(recording):
        if kind == "restart":
            segments.append(NavigationRun(first, after, tuple(lost), restored))
            first, lost, restored = before, [], began
        else:
            lost.append((after, before))
    return [*segments, NavigationRun(first, None, tuple(lost), restored)]


def _gaps(recording: Recording) -> Iterator[tuple[str, int, int, Restored]]:
    """Kind of each gap of navigation, the frames before and after it, and the refusals restored after it."""
    for topic, t_ns, _, _, data in recording.messages(GAP_TOPIC, kind="derived"):
        with using_message(topic, t_ns):
            note = parse_table(data)
            refusals = tuple(from_table(CarriedRefusal, row) for row in note.get("refusals", ()))
            restored = Restored(t_ns, refusals) if refusals else NOTHING_RESTORED
            gap = _text(note["kind"]), whole_number(note["after_seq"]), whole_number(note["before_seq"]), restored
        yield gap


def reprocess(
    recording: Recording,
    setup: Setup,
    out: Path,
    *,
    as_flown: bool,
    progress: Progress,
    observer: TerrainObserver | None = None,
) -> Path:
    """Run navigation over a recording; returns the new session folder below ``out``.

    progress : called periodically with the number of frames done;  observer : see ``fti.nav.pipeline``
    """
    segments = read_navigation_runs(recording) if as_flown else [NavigationRun(0, None)]
    frames = recording.frames()
    first = next(frames, None)
    if first is None:
        raise MissingError(f"{recording.path}: contains no frames")
    ground = setup.load_terrain()
    session = setup.config.session
    texts = {CONFIG_ATTACHMENT: setup.config.text, **setup.texts}
    folder = SessionFolder.create(out, session.name, first.t_rx_ns)
    log = DerivedLog(
        folder,
        LogSettings(
            split_s=session.split_s,
            split_mb=session.split_mb,
            attachments=[(name, "text/plain", text.encode()) for name, text in texts.items()],
            metadata={"fti": {**recording.metadata.get("fti", {}), "reprocessed": "true"}},
        ),
    )
    with contextlib.closing(log), infrequent_gc():
        done = 0
        frames = itertools.chain((first,), frames)
        for segment in segments:
            fresh = setup.make_chain(observer)
            _write(fresh.restore(segment.restored.refusals, segment.restored.t_ns), log)
            readmission_replay = _ReadmissionReplay(fresh, setup.readmissions_in(segment))
            chain = _TerrainReplay(readmission_replay, setup, ground, setup.terrain_notes_of(segment))
            for _ in _feed(frames, segment, chain, log):
                done += 1
                if done % FLUSH_FRAMES == 0:
                    log.flush()
                    progress(done)
            frames = recording.frames()
    return folder.path


@contextmanager
def infrequent_gc() -> Iterator[None]:
    """Collect cycles rarely: measurements are in no cycles, and the default threshold costs a tenth of the time."""
    before = gc.get_threshold()
    gc.set_threshold(GC_THRESHOLD, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


class _ReadmissionReplay:
    """A chain that gets each readmission before the same frame as in flight."""

    def __init__(self, chain: Chain, readmissions: list[Readmission]) -> None:
        self._chain, self._waiting = chain, deque(readmissions)
        self.reset_after_gap, self.set_terrain = chain.reset_after_gap, chain.set_terrain

    def feed(self, frame: RawFrame) -> list[ChainOutput]:
        """Outputs of due readmissions and of the frame."""
        out: list[ChainOutput] = []
        while self._waiting and frame.seq > self._waiting[0].after_seq:
            due = self._waiting.popleft()
            out.append(self._chain.readmit(due.source, due.after_seq, due.t_ns))
        return [*out, self._chain.feed(frame)]


class _TerrainReplay:
    """A chain that gets its terrain, or each square of it, before the same frame as in flight.

    ground : the whole terrain; None: squares
    """

    def __init__(
        self, chain: _ReadmissionReplay, setup: Setup, ground: Ground | None, notes: list[TerrainNote]
    ) -> None:
        self._chain, self._setup, self._ground, self._waiting = chain, setup, ground, deque(notes)
        self._areas = setup.areas
        self.reset_after_gap = chain.reset_after_gap

    def feed(self, frame: RawFrame) -> list[ChainOutput]:
        """Outputs of the terrain, if it is due, and of the frame."""
        out: list[ChainOutput] = []
        while self._waiting and frame.seq > self._waiting[0].after_seq:
            note = self._waiting.popleft()
            ground = None if note.fault else self._ground or self._setup.load_area(note)
            out.append(self._chain.set_terrain(ground, note.fault, note.after_seq, note.t_ns or frame.t_rx_ns))
        out += self._chain.feed(frame)
        for nav in wanted_areas(self._areas, out):
            assert self._areas is not None
            loaded = self._areas.load(nav)
            out.append(self._chain.set_terrain(loaded.ground, loaded.fault, frame.seq, frame.t_rx_ns))
        return out


def _feed(
    frames: Iterator[RawFrame], segment: NavigationRun, chain: _TerrainReplay, log: DerivedLog
) -> Iterator[RawFrame]:
    passed = 0
    for frame in frames:
        if segment.contains(frame.seq):
            gaps = segment.gaps_before(frame.seq) if segment.lost else 0
            if gaps > passed:
                chain.reset_after_gap()
                passed = gaps
            for products in chain.feed(frame):
                _write(products, log)
            yield frame


def _write(products: ChainOutput, log: DerivedLog) -> None:
    for device, measurement in products.measurements:
        log.write_measurement(device, measurement)
    for note in products.notes:
        log.write_note(note)
    for output in products.outputs:
        log.write_output(output)
