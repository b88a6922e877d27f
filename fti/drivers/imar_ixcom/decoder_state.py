"""Decoder state from infrequent messages for frequent ones: sigmas and status words."""

from __future__ import annotations

from functools import lru_cache
from itertools import chain

from fti.drivers.imar_ixcom.deviations import UNKNOWN, StandardDeviations
from fti.drivers.imar_ixcom.options import Options
from fti.drivers.imar_ixcom.status import SYSTEM_ERRORS
from fti.drivers.imar_ixcom.wire import IxcomFrame
from fti.messages.measurements import DeviceStatus, Stamp

#: Maximum age of sigmas and status words [ns].
MAX_AGE_NS = 5_000_000_000


class DecoderState:
    """options : of the decoder."""

    def __init__(self, options: Options) -> None:
        self.options = options
        self._deviations: tuple[int, StandardDeviations] = (0, UNKNOWN)
        self._words: dict[str, tuple[int, tuple[str, ...]]] = {}
        self._last_flags: tuple[str, ...] | None = None

    def set_deviations(self, stamp: Stamp, deviations: StandardDeviations) -> None:
        """Store the sigmas of EKFSTDDEV."""
        self._deviations = stamp.t_rx_ns, deviations

    def deviations(self, stamp: Stamp) -> StandardDeviations:
        """The present standard deviations."""
        since_ns, deviations = self._deviations
        return deviations if 0 <= stamp.t_rx_ns - since_ns <= MAX_AGE_NS else UNKNOWN

    def set_status_words(self, source: str, stamp: Stamp, flags: tuple[str, ...]) -> None:
        """Store the flags of a message.  source : its name."""
        self._words[source] = stamp.t_rx_ns, flags

    def flags(self, frame: IxcomFrame) -> tuple[str, ...]:
        """The flags of the footer and of the present status words."""
        if not self._words:
            return frame.footer.flags
        now = frame.stamp.t_rx_ns
        current = [flags for since, flags in self._words.values() if 0 <= now - since <= MAX_AGE_NS]
        return _merge_flags(frame.footer.flags, *current)

    def status(self, frame: IxcomFrame, always: bool) -> list[DeviceStatus]:
        """The status, after a change or always."""
        flags = self.flags(frame)
        if flags == self._last_flags and not always:
            return []
        self._last_flags = flags
        ok = frame.footer.ok and SYSTEM_ERRORS.isdisjoint(flags)
        return [DeviceStatus(stamp=frame.stamp, ok=ok, flags=flags)]


@lru_cache(maxsize=256)
def _merge_flags(*words: tuple[str, ...]) -> tuple[str, ...]:
    """The flags of all words, each once."""
    return tuple(dict.fromkeys(chain.from_iterable(words)))
