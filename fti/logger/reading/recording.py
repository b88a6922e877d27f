"""Reader of a recorded session: its files, frames, messages, attachments and metadata."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

from fti.errors import MissingError, RecordingError
from fti.logger.log_layout import FILE_METADATA, STORAGE_TARGET_KEY
from fti.logger.raw_log import LINKS_METADATA
from fti.logger.reading.mcap_file import Head, McapFile, McapMessage
from fti.logger.reading.session_locator import check_session_path
from fti.logger.session import Kind, SessionFolder, name_parts
from fti.messages.frames import TICK_LINK, RawFrame
from fti.messages.topics import RAW_PREFIX, SENT_PREFIX, TICK_TOPIC

#: Number of frames that wait for an earlier one before the files are searched for it.
MAX_WAITING_FRAMES = 50_000
_SEQ = itemgetter(0)
KINDS: tuple[Kind, ...] = ("raw", "derived", "truth", "snapshot")


@dataclass(frozen=True, slots=True)
class FileFault:
    """A file that ends early or is damaged; text : the fault."""

    path: Path
    text: str


class Recording:
    """A session folder or a single file, finished or not.

    raw_files, derived_files, truth_files, snapshot_files : in order
    faults  : filled by reading: files that end early
    on_read : called, when set, with a file and the number of bytes read
    """

    def __init__(
        self, path: Path, raw: list[Path], derived: list[Path], truth: list[Path], snapshot: list[Path]
    ) -> None:
        self.path = path
        self.raw_files = raw
        self.derived_files = derived
        self.truth_files = truth
        self.snapshot_files = snapshot
        self.faults: dict[Path, FileFault] = {}
        self._yielded: dict[int, McapMessage] = {}
        self.on_read: Callable[[Path, int], None] | None = None

    @classmethod
    def open(cls, path: str | Path, *others: str | Path) -> Recording:
        """Open a session folder or one MCAP file.  Raises MissingError.

        others : more folders and files of the same session, on other media
        """
        first = cls(Path(path), *_find_files(Path(path)))
        for other in map(Path, others):
            part = cls(other, *_find_files(other))
            if part.session != first.session:
                raise MissingError(f"{other}: belongs to session {part.session}, but {path} to session {first.session}")
            for kind in KINDS:
                known_files = {file.resolve() for file in first.paths(kind)}
                first.paths(kind).extend(file for file in part.paths(kind) if file.resolve() not in known_files)
                first.paths(kind).sort(key=lambda file: name_parts(file)[1])
        return first

    @property
    def files(self) -> list[Path]:
        """All files: raw, derived, truth, snapshot."""
        return [path for kind in KINDS for path in self.paths(kind)]

    def find_unfinished_files(self) -> list[Path]:
        """The files without a footer, which are being written or were cut off."""
        return [path for path in self.files if not McapFile(path).is_finished()]

    @cached_property
    def _head(self) -> Head:
        return McapFile(self.files[0]).head()

    @property
    def session(self) -> str:
        """Name of the session."""
        return self.metadata.get(FILE_METADATA, {}).get("session", self.path.stem)

    @property
    def other_folders(self) -> list[Path]:
        """Folders that the files name and of which no file is open: they may hold more of the session."""
        file_table = self.metadata.get(FILE_METADATA, {})
        named = [
            Path(folder)
            for key, folder in sorted(file_table.items())
            if key.startswith(STORAGE_TARGET_KEY) and "\0" not in folder
        ]
        known_folders = {file.parent.resolve() for file in self.files}
        return [folder for folder in named if folder.resolve() not in known_folders]

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata of the session: name -> table (``fti`` : the session's own)."""
        return self._head.metadata

    def attachments(self) -> dict[str, bytes]:
        """Attachments of the session: name -> content."""
        return self._head.attachments

    @property
    def links(self) -> dict[str, str]:
        """The recorded links, including silent ones: name -> kind."""
        return self.metadata.get(LINKS_METADATA, {})

    # ------------------------------------------------------------------------------------------------------ reading

    def frames(self) -> Iterator[RawFrame]:
        """Frames of all links and ticks (link ``TICK_LINK``) strictly in order of their full ``seq``.

        Raises RecordingError for a duplicate number, except for copies, which a change of the medium leaves.
        """
        for seq, (topic, t_ns, _, _, data) in self.numbered_messages():
            role = _role(topic.name)
            if role and not role.sent:
                yield RawFrame(role.link, seq, t_ns, data)

    def sent_frames(self) -> Iterator[RawFrame]:
        """Sent frames of the links, in order of ``seq``."""
        for seq, (topic, t_ns, _, _, data) in self.numbered_messages():
            role = _role(topic.name)
            if role and role.sent:
                yield RawFrame(role.link, seq, t_ns, data)

    def items(self, kind: Kind) -> Iterator[McapMessage]:
        """All messages of the files of a kind, in the order of the files."""
        return chain.from_iterable(self._chunks(self.paths(kind)))

    def messages(self, topic_prefix: str = "", kind: Kind = "derived") -> Iterator[tuple[str, int, int, int, bytes]]:
        """(topic, log time, publish time, sequence, data) of the files of a kind, in the order of the files."""
        for item in self.items(kind):
            if item.topic.name.startswith(topic_prefix):
                yield item.topic.name, item.log_time, item.publish_time, item.sequence, item.data

    def paths(self, kind: Kind) -> list[Path]:
        """The files of a kind."""
        return {
            "raw": self.raw_files,
            "derived": self.derived_files,
            "truth": self.truth_files,
            "snapshot": self.snapshot_files,
        }[kind]

    @property
    def frame_files(self) -> list[Path]:
        """The files with the frames, each frame once: snapshots of a continuous recording hold copies."""
        only = self.is_snapshot_session or not self.raw_files
        return [*self.raw_files, *(self.snapshot_files if only else ())]

    @property
    def is_snapshot_session(self) -> bool:
        """Were frames recorded around triggers only, in the snapshot files?  Ticks are in the raw ones too."""
        return self.metadata.get("fti", {}).get("mode") == "snapshot"

    @property
    def is_reprocessed(self) -> bool:
        """Was the session made by reprocessing the raw files of another folder?"""
        return self.metadata.get("fti", {}).get("reprocessed") == "true"

    def _chunks(self, paths: list[Path]) -> Iterator[list[McapMessage]]:
        for path in paths:
            file = McapFile(path)
            for chunk in file.chunks():
                yield chunk
                if self.on_read:
                    self.on_read(path, file.position)
            if self.on_read:
                self.on_read(path, path.stat().st_size)
            if file.fault:
                self.faults[path] = FileFault(path, file.fault)

    def _frame_chunks(self) -> Iterator[list[McapMessage]]:
        """The chunks of the files with the frames; ticks from the raw files only, if there are any."""
        yield from self._chunks(self.raw_files)
        for chunk in self._chunks(self.frame_files[len(self.raw_files) :]):
            yield [item for item in chunk if item.topic.name != TICK_TOPIC] if self.raw_files else chunk

    def _numbered_chunks(self) -> Iterator[list[tuple[int, McapMessage]]]:
        """Numbered messages with their full ``seq``, in the order of the files."""
        last: int | None = None
        for chunk in self._frame_chunks():
            numbered_messages = []
            for item in chunk:
                if _role(item.topic.name):
                    last = unwrap(item.sequence, last)
                    numbered_messages.append((last, item))
            yield numbered_messages

    def numbered_messages(self) -> Iterator[tuple[int, McapMessage]]:
        """Frames, ticks and sent bytes in order of ``seq``, as (seq, item).  Raises RecordingError as ``frames``.

        Links are written one after another, so a message may follow later ones.  A message is yielded when its number
        is the next, or, once too many wait, when no smaller number follows in the files.
        """
        waiting: list[tuple[int, McapMessage]] = []
        following: list[int] | None = None
        expected = 0
        for position, numbered_messages in enumerate(self._numbered_chunks()):
            waiting = sorted(waiting + numbered_messages, key=_SEQ)
            if following is None and len(waiting) > len(numbered_messages) + MAX_WAITING_FRAMES:
                following = self._smallest_following()
            limit = following[position] if following else 0
            yielded_count = 0
            for entry in waiting:
                if entry[0] > expected and entry[0] >= limit:
                    break
                yielded_count += 1
                if entry[0] >= expected or not self._is_copy(entry, expected):
                    expected = entry[0] + 1
                    yield entry
            del waiting[:yielded_count]
        for entry in waiting:
            if entry[0] >= expected or not self._is_copy(entry, expected):
                expected = entry[0] + 1
                yield entry

    def _is_copy(self, entry: tuple[int, McapMessage], expected: int) -> bool:
        """Was the same message yielded before?  Raises RecordingError for another message with this number.

        Messages that a failed medium may hold are written to the next one too.
        """
        seq, item = entry
        if seq not in self._yielded:
            self._yielded = self._first_messages(seq, expected)
        if self._yielded.get(seq) != item:
            raise RecordingError(f"{item.topic.name}: the number {seq} comes after {expected - 1}; it occurs twice")
        return True

    def _first_messages(self, first: int, end: int) -> dict[int, McapMessage]:
        """The first message with each of these numbers in the files."""
        found: dict[int, McapMessage] = {}
        for numbered_messages in self._numbered_chunks():
            for seq, item in numbered_messages:
                if first <= seq < end:
                    found.setdefault(seq, item)
            if len(found) == end - first:
                break
        return found

    def _smallest_following(self) -> list[int]:
        smallest = [
            min((seq for seq, _ in numbered_messages), default=2**64) for numbered_messages in self._numbered_chunks()
        ]
        following, smallest_later = [2**64] * len(smallest), 2**64
        for position in range(len(smallest) - 1, -1, -1):
            following[position] = smallest_later
            smallest_later = min(smallest_later, smallest[position])
        return following


def unwrap(sequence: int, last: int | None) -> int:
    """The full number nearest to ``last`` with the low 32 bits ``sequence``; never negative."""
    if last is None:
        return sequence
    full = last + ((sequence - last + 2**31) & 0xFFFF_FFFF) - 2**31
    return full if full >= 0 else full + 2**32


class _Role(NamedTuple):
    """A numbered topic: its link, and whether its frames were sent."""

    link: str
    sent: bool


@cache
def _role(topic: str) -> _Role | None:
    """Role of a topic; None without numbers."""
    if topic == TICK_TOPIC:
        return _Role(TICK_LINK, sent=False)
    if topic.startswith((RAW_PREFIX, SENT_PREFIX)):
        return _Role(topic.split("/", 2)[2], sent=topic.startswith(SENT_PREFIX))
    return None


def _find_files(path: Path) -> Iterator[list[Path]]:
    """The files of a folder of each kind, or a single file.  Raises MissingError."""
    check_session_path(path)
    if path.is_dir():
        folder = SessionFolder(path)
        return iter([folder.files(kind) for kind in KINDS])
    stated = McapFile(path).head().metadata.get(FILE_METADATA, {}).get("kind")
    own_kind = next((kind for kind in KINDS if kind == stated), name_parts(path)[0])
    return ([path] if own_kind == kind else [] for kind in KINDS)
