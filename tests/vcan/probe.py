"""Runs inside the user-mode kernel: all probes, one after the other.

python -m tests.vcan.probe OUT    writes what they saw to OUT as JSON.  Nothing is judged here: the tests do.
"""

from __future__ import annotations

import asyncio
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from tests.vcan import probe_pickups, probe_socketcan


def probe() -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        return {
            "socketcan": asyncio.run(probe_socketcan.probe()),
            "pickups": asyncio.run(probe_pickups.probe(Path(folder))),
        }


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(json.dumps(probe(), indent=1))
