"""A recorded session as a whole: its files, frames, messages, attachments and metadata."""

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
from fti.logger.raw_log import LINKS_METADATA, TICK_TOPIC
from fti.logger.reading.mcap_file import Head, McapFile, McapMessage
from fti.logger.reading.session_locator import check_session_path
from fti.logger.session import Kind, SessionFolder, name_parts
from fti.types import TICK_LINK, RawFrame

RAW_PREFIX, SENT_PREFIX = "/raw/", "/tx/"
#: Frames that wait for an earlier one before the files are searched for whether it comes at all.
MAX_WAITING_FRAMES = 50_000
_SEQ = itemgetter(0)
KINDS: tuple[Kind, ...] = ("raw", "derived", "truth", "snapshot")


@dataclass(frozen=True, slots=True)
class FileFault:
    """A file that does not end as it should; text : what is the matter with it."""

    path: Path
    text: str


class Recording:
    """A session folder or a single file, finished or not.

    raw_files, derived_files, truth_files, snapshot_files : in order
    faults  : filled by reading: files that broke off
    on_read : told, when set, how far a file has been read [bytes].
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

        others : more folders and files of the same session, whose medium was changed
        """
        first = cls(Path(path), *_find_files(Path(path)))
        for other in map(Path, others):
            part = cls(other, *_find_files(other))
            if part.session != first.session:
                raise MissingError(f"{other}: is of session {part.session}, and {path} of session {first.session}")
            for kind in KINDS:
                here = {file.resolve() for file in first.paths(kind)}
                first.paths(kind).extend(file for file in part.paths(kind) if file.resolve() not in here)
                first.paths(kind).sort(key=lambda file: name_parts(file)[1])
        return first

    @property
    def files(self) -> list[Path]:
        """All files: raw, derived, truth, snapshot."""
        return [path for kind in KINDS for path in self.paths(kind)]

    @property
    def unfinished_files(self) -> list[Path]:
        """The files without a footer: they are being written, or were cut off."""
        return [path for path in self.files if not McapFile(path).finished]

    @cached_property
    def _head(self) -> Head:
        return McapFile(self.files[0]).head()

    @property
    def session(self) -> str:
        """Name of the session."""
        return self.metadata.get(FILE_METADATA, {}).get("session", self.path.stem)

    @property
    def other_folders(self) -> list[Path]:
        """Folders in which more of the session may lie: the files name them, and none of theirs is here."""
        told = self.metadata.get(FILE_METADATA, {})
        named = [
            Path(folder)
            for key, folder in sorted(told.items())
            if key.startswith(STORAGE_TARGET_KEY) and "\0" not in folder
        ]
        here = {file.parent.resolve() for file in self.files}
        return [folder for folder in named if folder.resolve() not in here]

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata of the session: name -> table (``fti`` : the session's own)."""
        return self._head.metadata

    def attachments(self) -> dict[str, bytes]:
        """Attachments of the session: name -> content."""
        return self._head.attachments

    @property
    def links(self) -> dict[str, str]:
        """The links that were recorded: name -> kind; also those that were silent."""
        return self.metadata.get(LINKS_METADATA, {})

    # ------------------------------------------------------------------------------------------------------ reading

    def frames(self) -> Iterator[RawFrame]:
        """Frames of all links and ticks (link ``TICK_LINK``) strictly in order of their full ``seq``.

        Raises RecordingError when a number stands twice; not where it is a copy, as where the medium was changed.
        """
        for seq, (topic, t_ns, _, _, data) in self.numbered_messages():
            role = _role(topic.name)
            if role and not role.sent:
                yield RawFrame(role.link, seq, t_ns, data)

    def sent(self) -> Iterator[RawFrame]:
        """What was sent on the links, in order of ``seq``."""
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
        """The files that have the frames, each once: a snapshot beside a continuous recording has copies."""
        only = self.is_snapshot_session or not self.raw_files
        return [*self.raw_files, *(self.snapshot_files if only else ())]

    @property
    def is_snapshot_session(self) -> bool:
        """Frames were recorded around triggers only, in the snapshot files; ticks are in the raw ones, too."""
        return self.metadata.get("fti", {}).get("mode") == "snapshot"

    @property
    def is_reprocessed(self) -> bool:
        """Made by navigation once more, from the raw files of another folder."""
        return self.metadata.get("fti", {}).get("reprocessed") == "true"

    def _chunks(self, paths: list[Path]) -> Iterator[list[McapMessage]]:
        for path in paths:
            file = McapFile(path)
            for chunk in file.chunks():
                yield chunk
                if self.on_read:
                    self.on_read(path, file.position)
            if file.fault:
                self.faults[path] = FileFault(path, file.fault)

    def _frame_chunks(self) -> Iterator[list[McapMessage]]:
        """The chunks of the files that have the frames; ticks of raw files only, where there are any."""
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

        Links are written one after another, so a message may stand behind later ones.  A message is given out when it
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
            given = 0
            for entry in waiting:
                if entry[0] > expected and entry[0] >= limit:
                    break
                given += 1
                if entry[0] >= expected or not self._is_copy(entry, expected):
                    expected = entry[0] + 1
                    yield entry
            del waiting[:given]
        for entry in waiting:
            if entry[0] >= expected or not self._is_copy(entry, expected):
                expected = entry[0] + 1
                yield entry

    def _is_copy(self, entry: tuple[int, McapMessage], expected: int) -> bool:
        """Was the same given out already?  Raises RecordingError when it was another one with this number.

        What a medium may have taken before it was given up stands on the next one too.
        """
        seq, item = entry
        if seq not in self._yielded:
            self._yielded = self._find_given(seq, expected)
        if self._yielded.get(seq) != item:
            raise RecordingError(f"{item.topic.name}: the number {seq} comes after {expected - 1}; it stands twice")
        return True

    def _find_given(self, first: int, end: int) -> dict[int, McapMessage]:
        """The first message with each of these numbers, from the beginning of the files."""
        found: dict[int, McapMessage] = {}
        for numbered_messages in self._numbered_chunks():
            for seq, item in numbered_messages:
                if first <= seq < end:
                    found.setdefault(seq, item)
            if len(found) == end - first:
                break
        return found

    def _smallest_following(self) -> list[int]:
        """For each chunk the smallest number in all later chunks."""
        smallest = [
            min((seq for seq, _ in numbered_messages), default=2**64) for numbered_messages in self._numbered_chunks()
        ]
        following, least = [2**64] * len(smallest), 2**64
        for position in range(len(smallest) - 1, -1, -1):
            following[position] = least
            least = min(least, smallest[position])
        return following


def unwrap(sequence: int, last: int | None) -> int:
    """The full number whose low 32 bits are ``sequence`` and which is nearest to ``last``; never negative."""
    if last is None:
        return sequence
    full = last + ((sequence - last + 2**31) & 0xFFFF_FFFF) - 2**31
    return full if full >= 0 else full + 2**32


class _Role(NamedTuple):
    """A numbered topic: the link whose frames it has, and whether they were sent."""

    link: str
    sent: bool


@cache
def _role(topic: str) -> _Role | None:
    """What a topic is; None when it is not numbered."""
    if topic == TICK_TOPIC:
        return _Role(TICK_LINK, sent=False)
    if topic.startswith((RAW_PREFIX, SENT_PREFIX)):
        return _Role(topic.split("/", 2)[2], sent=topic.startswith(SENT_PREFIX))
    return None


def _find_files(place: Path) -> Iterator[list[Path]]:
    """The files of a folder of each kind, or a single file.  Raises MissingError."""
    check_session_path(place)
    if place.is_dir():
        folder = SessionFolder(place)
        return iter([folder.files(kind) for kind in KINDS])
    told = _kind_of(place)
    return ([place] if told == kind else [] for kind in KINDS)


def _kind_of(path: Path) -> Kind:
    """Kind of a single file, as it says itself, or else its name."""
    told = McapFile(path).head().metadata.get(FILE_METADATA, {}).get("kind")
    return next((kind for kind in KINDS if kind == told), name_parts(path)[0])
