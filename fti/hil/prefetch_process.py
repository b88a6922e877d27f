"""Frames of a recording, read ahead by a process of their own.

Reading a chunk and sorting it holds the interpreter for tens of milliseconds, many times what a frame may be late: a
thread would hold up who sends, so it is a process (docs/decisions/0020).  It reads as far ahead as a pipe holds.

    standard input    the request, as JSON
    standard output   pickled batches of (link, seq, t_rx_ns, data); what went wrong, as an FtiError; at the end: []
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import IO

from fti.errors import FtiError, RecordingError
from fti.logger.reading.recording import Recording
from fti.types import TICK_LINK, RawFrame

SECOND_NS = 1_000_000_000
#: Frames that are handed over together, and what the pipe may hold: seconds of the usual rates.
BATCH_FRAMES, PIPE_BYTES = 256, 1 << 20
TERMINATE_TIMEOUT_S = 5.0


@dataclass(frozen=True, slots=True)
class PrefetchRequest:
    """Which frames.  path : of the session; the rest : see ``select_frames``"""

    path: str
    from_s: float = 0.0
    only: Sequence[str] = ()
    loop: bool = False

    def frames(self) -> Iterator[RawFrame]:
        """The frames.  Raises MissingError where there is no such session."""
        recording = Recording.open(Path(self.path))
        yield from select_frames(recording.frames, from_s=self.from_s, only=self.only, loop=self.loop)


def select_frames(
    frames: Callable[[], Iterable[RawFrame]], *, from_s: float = 0.0, only: Sequence[str] = (), loop: bool = False
) -> Iterator[RawFrame]:
    """The frames that a replay sends; t_rx_ns counts from its begin, which is from_s after the first frame.

    frames : makes an iterator over a recording, anew for each pass
    only   : these links alone (none named: all); loop : the first frame again at the instant of the last, for ever
    """
    begin_ns = end_ns = 0
    while True:
        links = (frame for frame in frames() if frame.link != TICK_LINK)
        origin_ns, found = None, False
        for frame in links:
            if origin_ns is None:
                origin_ns = frame.t_rx_ns + round(from_s * SECOND_NS)
            if frame.t_rx_ns >= origin_ns and (not only or frame.link in only):
                end_ns = max(end_ns, begin_ns + frame.t_rx_ns - origin_ns)
                found = True
                yield RawFrame(frame.link, frame.seq, begin_ns + frame.t_rx_ns - origin_ns, frame.data)
        if not loop or not found:
            return
        begin_ns = end_ns


class PrefetchProcess:
    """The frames of a request, read before they are wanted; use it as a context, which gives the iterator.

    The process begins with the object.  Raises, in its place, what reading raised.
    """

    def __init__(self, request: PrefetchRequest) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "fti.hil.prefetch_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for who sends
        )
        assert self._process.stdin and self._process.stdout
        self._pipe = self._process.stdout
        with contextlib.suppress(OSError):  # an unprivileged user may have used up what pipes may hold
            fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        with self._process.stdin as order:
            order.write(json.dumps(asdict(request)).encode())

    def __enter__(self) -> Iterator[RawFrame]:
        return self._take()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pipe.close()
        self._process.terminate()
        self._process.wait(TERMINATE_TIMEOUT_S)

    def _take(self) -> Iterator[RawFrame]:
        while batch := self._load():
            for one in batch:
                yield RawFrame(*one)

    def _load(self) -> list[tuple[str, int, int, bytes]]:
        try:
            batch: list[tuple[str, int, int, bytes]] | FtiError = pickle.load(self._pipe)  # noqa: S301  our own process
        except (EOFError, pickle.UnpicklingError):
            raise RecordingError("the process that reads the recording has ended before the recording did") from None
        if isinstance(batch, FtiError):
            raise batch
        return batch


def write_batches(frames: Iterator[RawFrame], pipe: IO[bytes]) -> None:
    """Write frames as batches, and at the end that it is one."""

    def write(batch: object) -> None:
        pickle.dump(batch, pipe, pickle.HIGHEST_PROTOCOL)
        pipe.flush()

    try:
        while batch := [(f.link, f.seq, f.t_rx_ns, f.data) for f in islice(frames, BATCH_FRAMES)]:
            write(batch)
    except FtiError as error:
        write(error)
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise
        write(RecordingError(f"{error.filename or 'the recording'}: cannot be read: {error.strerror}"))
    else:
        write([])


def main() -> None:
    """``python -m fti.hil.prefetch_process``: started by ``PrefetchProcess`` alone; it ends when nobody wants more."""
    request = PrefetchRequest(**json.load(sys.stdin))
    with contextlib.suppress(BrokenPipeError):
        write_batches(request.frames(), sys.stdout.buffer)


if __name__ == "__main__":
    main()
