"""Runs inside the user-mode kernel: emulator, daemon and score, as a user runs them, on two interfaces of the kernel.

python -m tests.vcan.probe_gauntlet OUT    writes what ``fti score`` said to OUT as JSON; the test judges.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path

from tests.e2e import flights, harness
from tests.helpers import KERNELS

os.environ["NUMBA_CACHE_DIR"] = str(KERNELS)  # compiled outside
#: Everything is slow here, and takes as long as it takes.
for module in (flights, harness):
    vars(module).update(START_S=600.0, END_S=600.0)
NAME = "gauntlet_socketcan"


def probe() -> dict[str, object]:
    """Exit code and words of the score."""
    with tempfile.TemporaryDirectory() as folder:
        flight = flights.fly(NAME, Path(folder) / NAME, None)
        done = harness.fti("score", NAME, str(flight.session), "--truth", str(flight.truth), timeout=300)
        frames = {link: len(flight.arrivals(link)) for link in ("air_can", "pickup_can")}
        return {"code": done.returncode, "said": done.stdout + done.stderr, "frames": frames}


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(json.dumps(probe(), indent=1))
