"""Records the sessions of this folder with the software as it is, on links of this machine.

    python tests/sessions/record.py [KIND ...]

Once for each version that changes what a file holds, never to make a test pass: a session of an earlier version cannot
be recorded again.  Each flight is emulated in real time past the daemon; the files are packed.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parent.parent
FTI = [sys.executable, "-m", "fti.cli.main"]
#: Seconds of each flight.
KINDS = {"demonstration": 16.0, "research_aircraft": 10.0, "uav": 12.0, "arinc429": 12.0, "fallbacks": 18.0}
#: What the operator does in the demonstration: seconds of the flight, and the command.
OPERATOR = [
    (4.0, ["mark", "established"]),
    (6.0, ["send", "pdu", "trip", "breaker=air_data"]),
    (14.0, ["acknowledge"]),
]
START_S = 120.0


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
        config, run_dir = write_config(kind, folder), folder / "run"
        places = ("--links", str(folder / "links"), "--run-dir", str(run_dir))
        flight = ("hil", str(FOLDER / f"{kind}.toml"), "--duration", str(duration_s), "--wait")
        hil = subprocess.Popen(
            [*FTI, *flight, "--config", str(config), *places],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert hil.stdout and hil.stdout.readline() == "ready\n"
        out = folder / "out"
        daemon = subprocess.Popen([*FTI, "run", str(config), "--origin", "hil", "--out", str(out), *places])
        await_navigation(run_dir)
        begin = time.monotonic()
        for at_s, command in OPERATOR if kind == "demonstration" else []:
            time.sleep(max(0.0, begin + at_s - time.monotonic()))
            subprocess.run([*FTI, *command, "--run-dir", str(run_dir)], check=False)
        hil.communicate()
        daemon.send_signal(2)
        daemon.wait()
        (session,) = out.iterdir()
        subprocess.run([*FTI, "pack", str(session)], check=True)
        to.mkdir(parents=True)
        return Path(shutil.move(session, to))


def await_navigation(run_dir: Path) -> None:
    """Until the daemon can be talked to.  Raises TimeoutError."""
    deadline = time.monotonic() + START_S
    while not (run_dir / "fti.json").exists():
        if time.monotonic() > deadline:
            raise TimeoutError("the daemon did not start")
        time.sleep(0.1)


def main(*kinds: str) -> None:
    """Record each kind, and say where it is."""
    for kind in kinds or KINDS:
        print(record(kind, KINDS[kind], FOLDER / version("fti") / kind))


if __name__ == "__main__":
    main(*sys.argv[1:])
