"""What a decoder remembers of the messages that come seldom for those that come often: sigmas and words of status."""

from __future__ import annotations

from functools import lru_cache
from itertools import chain

from fti.drivers._quick import quick_class
from fti.drivers.imar_ixcom.deviations import UNKNOWN, Deviations
from fti.drivers.imar_ixcom.options import Options
from fti.drivers.imar_ixcom.status import SYSTEM_ERRORS
from fti.drivers.imar_ixcom.wire import Frame
from fti.types import DeviceStatus, Stamp

#: What was said so long ago counts no more [ns].
KEPT_NS = 5_000_000_000
new_status = quick_class(DeviceStatus)


class Heard:
    """options : of the decoder."""

    def __init__(self, options: Options) -> None:
        self.options = options
        self._deviations: tuple[int, Deviations] = (0, UNKNOWN)
        self._words: dict[str, tuple[int, tuple[str, ...]]] = {}
        self._told: tuple[str, ...] | None = None

    def keep_deviations(self, stamp: Stamp, found: Deviations) -> None:
        """Take what EKFSTDDEV says."""
        self._deviations = stamp.t_rx_ns, found

    def deviations(self, stamp: Stamp) -> Deviations:
        """The standard deviations that hold now."""
        since_ns, found = self._deviations
        return found if 0 <= stamp.t_rx_ns - since_ns <= KEPT_NS else UNKNOWN

    def keep_words(self, source: str, stamp: Stamp, flags: tuple[str, ...]) -> None:
        """Take the conditions that a message names.  source : which message."""
        self._words[source] = stamp.t_rx_ns, flags

    def flags(self, frame: Frame) -> tuple[str, ...]:
        """The footer's conditions and those of the words that hold now."""
        if not self._words:
            return frame.footer.flags
        now = frame.stamp.t_rx_ns
        said = [flags for since, flags in self._words.values() if 0 <= now - since <= KEPT_NS]
        return _joined(frame.footer.flags, *said)

    def status(self, frame: Frame, always: bool) -> list[DeviceStatus]:
        """The status, if it is another than before, or always."""
        flags = self.flags(frame)
        if flags == self._told and not always:
            return []
        self._told = flags
        ok = frame.footer.ok and SYSTEM_ERRORS.isdisjoint(flags)
        return [new_status(stamp=frame.stamp, ok=ok, flags=flags)]


@lru_cache(maxsize=256)
def _joined(*words: tuple[str, ...]) -> tuple[str, ...]:
    """The flags of all words, each once."""
    return tuple(dict.fromkeys(chain.from_iterable(words)))
