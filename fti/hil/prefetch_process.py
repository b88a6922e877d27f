"""A process that prefetches the frames of a recording.

Reading and sorting a chunk holds the interpreter lock for tens of milliseconds.  In a thread this would delay the
sender, therefore a process reads (docs/decisions/0020).  It prefetches as much as the pipe holds.

    standard input    the request, as JSON
    standard output   pickled batches of (link, seq, t_rx_ns, data), or an FtiError; at the end an empty list
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

from fti.constants import SECOND_NS
from fti.errors import FtiError, RecordingError
from fti.logger.reading.recording import Recording
from fti.messages.frames import TICK_LINK, RawFrame

#: Frames per batch, and capacity of the pipe: seconds at usual rates.
BATCH_FRAMES, PIPE_BYTES = 256, 1 << 20
TERMINATE_TIMEOUT_S = 5.0


@dataclass(frozen=True, slots=True)
class PrefetchRequest:
    """Selection of frames.  path : of the session; other fields : see ``select_frames``"""

    path: str
    from_s: float = 0.0
    only: Sequence[str] = ()
    loop: bool = False

    def frames(self) -> Iterator[RawFrame]:
        """The frames.  Raises MissingError when the session does not exist."""
        recording = Recording.open(Path(self.path))
        yield from select_frames(recording.frames, from_s=self.from_s, only=self.only, loop=self.loop)


def select_frames(
    frames: Callable[[], Iterable[RawFrame]], *, from_s: float = 0.0, only: Sequence[str] = (), loop: bool = False
) -> Iterator[RawFrame]:
    """The frames that a replay sends; t_rx_ns counts from its beginning, which is from_s after the first frame.

    frames : returns a new iterator over a recording for each pass
    only   : send these links only (empty: all); loop : begin again at the time of the last frame, endlessly
    """
    begin_ns = end_ns = 0
    while True:
        links = (frame for frame in frames() if frame.link != TICK_LINK)
        origin_ns, has_frames = None, False
        for frame in links:
            if origin_ns is None:
                origin_ns = frame.t_rx_ns + round(from_s * SECOND_NS)
            if frame.t_rx_ns >= origin_ns and (not only or frame.link in only):
                end_ns = max(end_ns, begin_ns + frame.t_rx_ns - origin_ns)
                has_frames = True
                yield RawFrame(frame.link, frame.seq, begin_ns + frame.t_rx_ns - origin_ns, frame.data)
        if not loop or not has_frames:
            return
        begin_ns = end_ns


class PrefetchProcess:
    """Prefetches the frames of a request; a context manager that returns their iterator.

    The constructor starts the process.  The iterator raises the errors of reading at their place.
    """

    def __init__(self, request: PrefetchRequest) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "fti.hil.prefetch_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C must reach the sender only
        )
        assert self._process.stdin and self._process.stdout
        self._pipe = self._process.stdout
        with contextlib.suppress(OSError):  # the limit of pipe memory of an unprivileged user may be reached
            fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        with self._process.stdin as stdin:
            stdin.write(json.dumps(asdict(request)).encode())

    def __enter__(self) -> Iterator[RawFrame]:
        return (RawFrame(*fields) for batch in iter(self._load, []) for fields in batch)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pipe.close()
        self._process.terminate()
        self._process.wait(TERMINATE_TIMEOUT_S)

    def _load(self) -> list[tuple[str, int, int, bytes]]:
        try:
            batch: list[tuple[str, int, int, bytes]] | FtiError = pickle.load(self._pipe)  # noqa: S301  our own process
        except (EOFError, pickle.UnpicklingError):
            raise RecordingError("the process that reads the recording ended unexpectedly") from None
        if isinstance(batch, FtiError):
            raise batch
        return batch


def write_batches(frames: Iterator[RawFrame], pipe: IO[bytes]) -> None:
    """Write frames in batches, then an empty batch, or the error of reading."""

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
    """``python -m fti.hil.prefetch_process``: started by ``PrefetchProcess``; ends when the pipe is closed."""
    request = PrefetchRequest(**json.load(sys.stdin))
    with contextlib.suppress(BrokenPipeError):
        write_batches(request.frames(), sys.stdout.buffer)


if __name__ == "__main__":
    main()
