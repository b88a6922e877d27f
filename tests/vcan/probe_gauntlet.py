"""Runs inside the user-mode kernel: emulator and daemon, as a user runs them, on two interfaces of the kernel.

python -m tests.vcan.probe_gauntlet FOLDER    leaves session and truth file in a new folder; the test scores them.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from tests.e2e import flights, harness
from tests.helpers import ROOT, until

#: Everything is slow here, and takes as long as it takes.
for module in (flights, harness):
    vars(module).update(START_S=600.0, END_S=600.0)
NAME = "gauntlet_socketcan"
CONFIG = ROOT / "configs" / f"{NAME}.toml"


def fly(folder: Path) -> flights.Flight:
    """Past a daemon whose navigation is ready: it takes a while here, and a bus does not tell who listens."""
    config, links, truth = (
        flights.config_on_free_ports(CONFIG, folder),
        folder / "links",
        folder / "flight_truth_000.mcap",
    )
    with harness.daemon(config, folder / "out", "--links", str(links)) as running:
        until(lambda: "lag_ms" in running.health()["navigation"], harness.START_S, "navigation")
        with flights.emulator(NAME, config, links, "--wait", "--truth", str(truth)) as played:
            assert played.wait(timeout=harness.END_S) == 0, flights.emulator_log(config).read_text()
        session = running.session
        running.stop()
    return flights.Flight(session, truth)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as in_memory:
        flown, out = fly(Path(in_memory)), Path(sys.argv[1])
        shutil.copytree(flown.session, out / "session")
        shutil.copy(flown.truth, out)
