"""Frames of a recording, read ahead by a thread: reading and sorting a chunk takes longer than a frame may be late."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from types import TracebackType

from fti.errors import FtiError
from fti.types import RawFrame

#: Frames that are handed over together, and how many such batches may wait.
BATCH, BATCHES = 256, 64
POLL_S = 0.1


class Ahead:
    """An iterator over frames that were read before they are wanted; use it as a context.

    frames : makes the frames, in the thread; what it raises is raised here, in its place
    """

    def __init__(self, frames: Callable[[], Iterable[RawFrame]]) -> None:
        self._frames = frames
        self._batches: queue.Queue[list[RawFrame] | BaseException] = queue.Queue(BATCHES)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, name="fti-replay-ahead")

    def __enter__(self) -> Iterator[RawFrame]:
        self._thread.start()
        return self._take()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()

    def _take(self) -> Iterator[RawFrame]:
        while batch := self._batches.get():
            if isinstance(batch, BaseException):
                raise batch
            yield from batch

    def _read(self) -> None:
        try:
            frames = iter(self._frames())
            while (batch := list(islice(frames, BATCH))) and self._put(batch):
                pass
        except (FtiError, OSError) as error:
            self._put(error)
        finally:
            self._put([])

    def _put(self, batch: list[RawFrame] | BaseException) -> bool:
        """Hand over, as soon as there is room; false when nobody wants it any more."""
        while not self._ended.is_set():
            try:
                self._batches.put(batch, timeout=POLL_S)
            except queue.Full:
                continue
            return True
        return False
