"""A session that ``fti run`` recorded and a kill of all its processes ended, under damage; and the real next start."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

from tests.e2e.feeder import Feeder
from tests.e2e.harness import Daemon, daemon
from tests.helpers import until
from tests.logger.campaign.campaign import GROUPS, Case, cases, run_cases
from tests.logger.campaign.damage import KINDS
from tests.logger.campaign.mcap_parser import parse
from tests.logger.campaign.open_sessions import OpenSession
from tests.logger.campaign.rules import ClosingCheck, Truth

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]
SEED = 20260103
FRAMES = 700
#: Damage that needs no knowledge of what was synced.
COUNTS = {"flip": 14, "zero": 6, "cut": 6, "kill": 1}


def _feed(feeder: Feeder, running: Daemon, frames: int) -> None:
    until(lambda: running.health().get("links", {}).get("line", {}).get("state") == "silent", what="an open line")
    feeder.start()
    until(lambda: len(feeder.sent_lines) > frames, what="fed frames")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> OpenSession:
    """The raw file is the open one; what is in it was sent."""
    folder = tmp_path_factory.mktemp("recorded")
    with Feeder(folder / "links") as feeder:
        with daemon(feeder.config, folder / "out", "--links", str(feeder.links)) as running:
            path = running.session
            _feed(feeder, running, FRAMES)
            running.kill_all()
        feeder.stop()
    files = {file.name: file.read_bytes() for file in path.glob("*.mcap")}
    name = f"{path.name}_000.mcap"
    session = OpenSession(path.name, "recorded", files, name, files[name], parse(files[name]))
    for link in ("line", "eth"):
        data = [m.content.data for m in session.parsed.messages if m.content.channel[0] == f"/raw/{link}"]
        assert b"".join(feeder.sent_lines).startswith(b"".join(data))
        assert len(data) > FRAMES // 2
    return session


def _same(session: OpenSession) -> Callable[[Case], OpenSession]:
    return lambda case: session


def test_a_recorded_session_under_damage(recorded: OpenSession, scale: int) -> None:
    counts = {group: count * scale for group, count in COUNTS.items()}
    total = run_cases(cases(SEED, counts), session_of=_same(recorded))
    assert not total.failures, "\n".join(total.lines())


def test_the_next_start_with_damaged_sessions_beside_it(recorded: OpenSession, tmp_path: Path) -> None:
    kinds = [kind for group in COUNTS for kind in GROUPS[group]]
    out = tmp_path / "out"
    truths = {}
    for n, kind in enumerate(kinds):
        truth = Truth(recorded, KINDS[kind](recorded, Random(f"{SEED}/{kind}")))
        truths[recorded.put(out, truth.damaged.data, f"{n:02}_{recorded.name}")] = truth
    last = recorded.put(out, recorded.data, f"zz_{recorded.name}") / recorded.open_name
    with Feeder(tmp_path / "links") as feeder, daemon(feeder.config, out, "--links", str(feeder.links)) as running:
        until(lambda: parse(last.read_bytes()).has_summary, what="the last one of them closed")
        running.stop()
    output = "\n".join(running.lines)
    faults = []
    for folder, truth in truths.items():
        about = "\n".join(line for line in output.splitlines() if folder.name in line)
        texts = ClosingCheck(truth, folder).run(about)
        faults += [f"{folder.name}, {truth.damaged.place}: {fault}" for fault in texts]
    assert not faults, "\n".join([*faults, output])
