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
from fti.logger.mcap_file import Head, Item, McapFile
from fti.logger.raw_log import LINKS_METADATA, TICK_TOPIC
from fti.logger.session import Kind, SessionFolder, name_parts
from fti.logger.split_log import FILE_METADATA
from fti.types import TICK_LINK, RawFrame

RAW, SENT = "/raw/", "/tx/"
#: Frames that wait for an earlier one before the files are searched for whether it comes at all.
PATIENCE = 50_000
_SEQ = itemgetter(0)


@dataclass(frozen=True, slots=True)
class Fault:
    """A file that does not end as it should; text : what is the matter with it."""

    path: Path
    text: str


class Recording:
    """A session folder or a single file, finished or not.

    raw_files, derived_files, truth_files : in order.  ``faults`` is filled by reading: files that broke off.
    on_read : told, when set, how far a file has been read [bytes].
    """

    def __init__(self, path: Path, raw: list[Path], derived: list[Path], truth: list[Path]) -> None:
        self.path = path
        self.raw_files = raw
        self.derived_files = derived
        self.truth_files = truth
        self.faults: dict[Path, Fault] = {}
        self.on_read: Callable[[Path, int], None] | None = None

    @classmethod
    def open(cls, path: str | Path) -> Recording:
        """Open a session folder or one MCAP file.  Raises MissingError."""
        place = Path(path)
        if place.is_dir():
            folder = SessionFolder(place)
            recording = cls(place, folder.files("raw"), folder.files("derived"), folder.files("truth"))
            if not recording.files:
                raise MissingError(f"{place}: holds no MCAP files")
            return recording
        if not place.is_file():
            raise MissingError(f"{place}: there is no such session folder or file")
        kind = _kind_of(place)
        return cls(place, *([place] if kind == k else [] for k in ("raw", "derived", "truth")))

    @property
    def files(self) -> list[Path]:
        """All files: raw, derived, truth."""
        return [*self.raw_files, *self.derived_files, *self.truth_files]

    @property
    def unfinished(self) -> list[Path]:
        """The files without a footer: they are being written, or were cut off."""
        return [path for path in self.files if not McapFile(path).finished]

    @cached_property
    def _head(self) -> Head:
        return McapFile(self.files[0]).head()

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

        Raises RecordingError when a number stands twice.
        """
        for seq, (topic, t_ns, _, _, data) in self.numbered():
            role = _role(topic.name)
            if role and not role.sent:
                yield RawFrame(role.link, seq, t_ns, data)

    def sent(self) -> Iterator[RawFrame]:
        """What was sent on the links, in order of ``seq``."""
        for seq, (topic, t_ns, _, _, data) in self.numbered():
            role = _role(topic.name)
            if role and role.sent:
                yield RawFrame(role.link, seq, t_ns, data)

    def items(self, kind: Kind) -> Iterator[Item]:
        """All messages of the files of a kind, in the order of the files."""
        return chain.from_iterable(self._chunks(self.paths(kind)))

    def messages(self, topic_prefix: str = "", kind: Kind = "derived") -> Iterator[tuple[str, int, int, int, bytes]]:
        """(topic, log time, publish time, sequence, data) of the files of a kind, in the order of the files."""
        for item in self.items(kind):
            if item.topic.name.startswith(topic_prefix):
                yield item.topic.name, item.log_time, item.publish_time, item.sequence, item.data

    def paths(self, kind: Kind) -> list[Path]:
        """The files of a kind."""
        return {"raw": self.raw_files, "derived": self.derived_files, "truth": self.truth_files}[kind]

    def _chunks(self, paths: list[Path]) -> Iterator[list[Item]]:
        for path in paths:
            file = McapFile(path)
            for chunk in file.chunks():
                yield chunk
                if self.on_read:
                    self.on_read(path, file.position)
            if file.fault:
                self.faults[path] = Fault(path, file.fault)

    def _numbered_chunks(self) -> Iterator[list[tuple[int, Item]]]:
        """Numbered messages with their full ``seq``, in the order of the files."""
        last: int | None = None
        for chunk in self._chunks(self.raw_files):
            numbered = []
            for item in chunk:
                if _role(item.topic.name):
                    last = unwrap(item.sequence, last)
                    numbered.append((last, item))
            yield numbered

    def numbered(self) -> Iterator[tuple[int, Item]]:
        """Frames, ticks and sent bytes in order of ``seq``, as (seq, item).  Raises RecordingError as ``frames``.

        Links are written one after another, so a message may stand behind later ones.  A message is given out when it
        is the next, or, once too many wait, when no smaller number follows in the files.
        """
        waiting: list[tuple[int, Item]] = []
        following: list[int] | None = None
        expected = 0
        for position, numbered in enumerate(self._numbered_chunks()):
            waiting = sorted(waiting + numbered, key=_SEQ)
            if following is None and len(waiting) > len(numbered) + PATIENCE:
                following = self._smallest_following()
            limit = following[position] if following else 0
            given = 0
            for entry in waiting:
                if entry[0] > expected and entry[0] >= limit:
                    break
                expected = _checked(entry, expected) + 1
                given += 1
                yield entry
            del waiting[:given]
        for entry in waiting:
            expected = _checked(entry, expected) + 1
            yield entry

    def _smallest_following(self) -> list[int]:
        """For each chunk the smallest number in all later chunks."""
        smallest = [min((seq for seq, _ in numbered), default=2**64) for numbered in self._numbered_chunks()]
        following, least = [2**64] * len(smallest), 2**64
        for position in range(len(smallest) - 1, -1, -1):
            following[position] = least
            least = min(least, smallest[position])
        return following


def unwrap(sequence: int, last: int | None) -> int:
    """The full number whose low 32 bits are ``sequence`` and which is nearest to ``last``."""
    if last is None:
        return sequence
    return last + ((sequence - last + 2**31) & 0xFFFF_FFFF) - 2**31


def _checked(entry: tuple[int, Item], expected: int) -> int:
    seq, item = entry
    if seq < expected:
        raise RecordingError(f"{item.topic.name}: the number {seq} comes after {expected - 1}; it stands twice")
    return seq


class _Role(NamedTuple):
    """A numbered topic: the link whose frames it has, and whether they were sent."""

    link: str
    sent: bool


@cache
def _role(topic: str) -> _Role | None:
    """What a topic is; None when it is not numbered."""
    if topic == TICK_TOPIC:
        return _Role(TICK_LINK, sent=False)
    if topic.startswith((RAW, SENT)):
        return _Role(topic.split("/", 2)[2], sent=topic.startswith(SENT))
    return None


def _kind_of(path: Path) -> Kind:
    """Kind of a single file, as it says itself, or else its name."""
    told = McapFile(path).head().metadata.get(FILE_METADATA, {}).get("kind")
    return next((kind for kind in ("raw", "derived", "truth") if kind == told), name_parts(path)[0])
