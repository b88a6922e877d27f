"""What the controller of a CAN adapter says, from its answer to the ledger, the live view and the proof."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from fti.canframe import pack_can
from fti.hil.ports.lawicel import Adapter
from fti.links.slcan import format_frame
from tests.e2e.harness import Daemon, Line, daemon, fti
from tests.helpers import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]
CONFIG = """
[session]
name = "adapter"
directory = "unused"
min_free_mb = 10

[[link]]
name = "bus"
kind = "can"
interface = "slcan"
channel = "/dev/unused"

[display]
enabled = false
"""


class Attended:
    """An adapter on a line; it answers whenever somebody looks."""

    def __init__(self, line: Line) -> None:
        self.adapter = Adapter(lambda frame: None)
        self._line = line

    def until(self, look: Callable[[], object], what: str) -> None:
        """Answer until it is so."""

        def answer_and_look() -> object:
            for answer in self.adapter.feed(self._line.read()):
                self._line.write(answer)
            return look()

        until(answer_and_look, what=what)


def _errors(running: Daemon) -> dict[str, int]:
    errors: dict[str, int] = running.health()["links"]["bus"]["ledger"]["errors"]
    return errors


def test_an_overrun_of_an_adapter_is_in_the_ledger_the_view_and_the_proof(tmp_path: Path) -> None:
    config, links = tmp_path / "adapter.toml", tmp_path / "links"
    config.write_text(CONFIG)
    links.mkdir()
    line = Line(links / "bus")
    wait_for_readers = Attended(line)
    try:
        with daemon(config, tmp_path / "out", "--links", str(links)) as running:
            session = running.session
            wait_for_readers.until(lambda: _errors(running).get("slcan_data_overrun") == 0, "the first answer")
            wait_for_readers.adapter.flags = 0x08
            wait_for_readers.until(lambda: _errors(running)["slcan_data_overrun"], "the overrun")
            line.write(format_frame(pack_can(0x123, b"\x01")))
            wait_for_readers.until(lambda: running.health()["links"]["bus"]["frames"] == 1, "the frame")
            output = fti("watch", "--once", "--run-dir", str(running.run_dir)).stdout
            assert running.stop() == 130
    finally:
        line.close()
    proof = fti("verify", str(session))
    assert proof.returncode == 0, proof.stdout
    row = next(row for row in proof.stdout.splitlines() if row.startswith("/raw/bus"))
    assert row.split()[1:] == ["1", "1", "0", "16", "slcan_data_overrun", "1"]
    assert "slcan_data_overrun 1" in output
