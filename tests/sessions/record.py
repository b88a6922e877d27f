"""Records the sessions of this folder with the software as it is, on links of this machine.

    python -m tests.sessions.record [KIND ...]

Once for each version that changes what a file holds, never to make a test pass: a session of an earlier version cannot
be recorded again.  Each flight is emulated in real time past the daemon; the files are packed.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

from tests.e2e.flights import emulator
from tests.e2e.harness import END_S, START_S, daemon, fti
from tests.helpers import ROOT, until

FOLDER = Path(__file__).resolve().parent
#: Seconds of each flight.
KINDS = {"demonstration": 16.0, "research_aircraft": 10.0, "uav": 12.0, "arinc429": 12.0, "fallbacks": 18.0}
#: What the operator does in the demonstration: seconds of the flight, and the command.
OPERATOR = [
    (4.0, ["mark", "established"]),
    (6.0, ["send", "pdu", "trip", "breaker=air_data"]),
    (14.0, ["acknowledge"]),
]


def write_config(kind: str, folder: Path) -> Path:
    """The configuration of a kind, on loopback and ptys and without a page, beside what it names."""
    named = re.search(r'config = "\.\./\.\./configs/(.+)"', (FOLDER / f"{kind}.toml").read_text())
    assert named
    shutil.copytree(ROOT / "configs", folder / "configs")
    path = folder / "configs" / named[1]
    text = re.sub(r'"\d+\.\d+\.\d+\.\d+(:\d+)?"', lambda found: f'"127.0.0.1{found[1] or ""}"', path.read_text())
    text = re.sub(r'"socketcan"\nchannel = "(\w+)"', r'"slcan"\nchannel = "/dev/\1"', text)
    path.write_text(text + "\n[display]\nenabled = false\n")
    return path


def record(kind: str, duration_s: float, to: Path) -> Path:
    """One session, packed, below ``to``; the paths that it names are those of a temporary folder."""
    with tempfile.TemporaryDirectory(prefix="fti-", dir="/tmp") as name:
        folder = Path(name)
        config, links = write_config(kind, folder), folder / "links"
        flight = (str(FOLDER / f"{kind}.toml"), config, links, "--wait", "--duration", str(duration_s))
        with emulator(*flight) as flying:
            until(lambda: links.is_dir() or flying.poll() is not None, START_S, "the emulator's ports")
            with daemon(config, folder / "out", "--links", str(links), "--origin", "hil") as running:
                session, begin = running.session, time.monotonic()
                for at_s, command in OPERATOR if kind == "demonstration" else []:
                    time.sleep(max(0.0, begin + at_s - time.monotonic()))
                    assert fti(*command, "--run-dir", str(running.run_dir)).returncode == 0, command
                assert flying.wait(timeout=duration_s + END_S) == 0
                running.stop()
        assert fti("pack", str(session)).returncode == 0
        to.mkdir(parents=True)
        return Path(shutil.move(session, to))


def main(*kinds: str) -> None:
    """Record each kind, and say where it is."""
    for kind in kinds or KINDS:
        print(record(kind, KINDS[kind], FOLDER / version("fti") / kind))


if __name__ == "__main__":
    main(*sys.argv[1:])
