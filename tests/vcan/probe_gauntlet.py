"""Runs inside the user-mode kernel: emulator, daemon and score, as a user runs them, on two interfaces of the kernel.

python -m tests.vcan.probe_gauntlet OUT    writes what ``fti score`` said to OUT as JSON; the test judges.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from pathlib import Path

from tests.e2e import flights, harness
from tests.helpers import ROOT, until

#: Everything is slow here, and takes as long as it takes.
for module in (flights, harness):
    vars(module).update(START_S=600.0, END_S=600.0)
NAME = "gauntlet_socketcan"
ATTEMPTS = 3
#: The score's words of a flight in which the bench was late for longer, or more often, than is allowed.
TOO_LATE = re.compile(r"the bench was late [^;]*; \d+% are allowed")
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


def probe() -> dict[str, object]:
    """Exit code and words of the score; flown again where the bench was too late for a score."""
    for _ in range(ATTEMPTS):
        with tempfile.TemporaryDirectory() as folder:
            flight = fly(Path(folder))
            done = harness.fti("score", NAME, str(flight.session), "--truth", str(flight.truth), timeout=300)
            frames = {link: len(flight.arrivals(link)) for link in ("air_can", "pickup_can")}
        if not TOO_LATE.search(done.stdout):
            break
    return {"code": done.returncode, "said": done.stdout + done.stderr, "frames": frames}


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(json.dumps(probe(), indent=1))
