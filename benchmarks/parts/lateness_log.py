"""``fti`` unchanged, with a log: when each message was due, and how late it was sent.

    python -m benchmarks.parts.lateness_log FILE hil|replay ...

FILE gets, as .npz: ``due`` (time.monotonic [s]), ``late`` [s], ``sender`` (an index), ``names`` (of devices or links).
"""

from __future__ import annotations

import atexit
import sys
import time
from array import array
from pathlib import Path

import numpy as np

from fti.cli.main import main
from fti.hil.device_streams import SensorStream
from fti.hil.replay_clock import FrameStream
from fti.hil.scheduler import MeteredStream, Scheduler


def log_into(file: Path) -> None:
    """Log the times of every scheduler of this process, and write them at exit."""
    due, late, sender, names = array("d"), array("d"), array("H"), dict[str, int]()
    note = Scheduler._note

    def noted(self: Scheduler, due_s: float, meter: MeteredStream | None) -> None:
        if meter is not None:
            now, late_s = time.monotonic(), self._now() - due_s
            due.append(now - late_s)
            late.append(late_s)
            sender.append(names.setdefault(_name(meter), len(names)))
        note(self, due_s, meter)

    Scheduler._note = noted  # type: ignore[method-assign, assignment]
    atexit.register(lambda: np.savez(file, due=due, late=late, sender=sender, names=list(names)))


def _name(meter: MeteredStream) -> str:
    if isinstance(meter, FrameStream):
        assert meter._next is not None
        return meter._next.link
    assert isinstance(meter, SensorStream)
    return meter.meter.name


if __name__ == "__main__":
    log_into(Path(sys.argv[1]))
    sys.exit(main(sys.argv[2:]))
