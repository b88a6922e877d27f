"""Lines in the chain: two devices that share one, and what a gap leaves of one."""

from __future__ import annotations

import tomllib
from pathlib import Path

from fti import config
from fti.devices import bind_devices
from fti.messages.frames import LinkState, RawFrame
from fti.messages.measurements import Range
from fti.service.navigation.decode_chain import Chain
from fti.service.navigation.device_monitor import WINDOW, DeviceMonitor

SHARED = """
session = { name = "bench" }

[[link]]
name = "line"
kind = "serial"
port = "/dev/ttyUSB0"

[[device]]
name = "wind"
link = "line"
driver = "ascii_line"
options = { line = "W{speed:.1f}", fields = [], lost_lines = [] }

[[device]]
name = "rain"
link = "line"
driver = "ascii_line"
options = { line = "R{level:.1f}", fields = [], lost_lines = [] }
"""
LASER = """
session = { name = "bench" }
link = [{ name = "line", kind = "serial", port = "/dev/ttyUSB0" }]
device = [{ name = "laser", link = "line", driver = "lightware_ascii" }]
"""
SECOND_NS = 1_000_000_000


def chain_of(text: str) -> tuple[config.Config, Chain]:
    result = config.parse(tomllib.loads(text), text, Path("bench.toml"))
    return result, Chain(result, bind_devices(result, {}), None)


def test_the_lines_of_another_device_are_no_damage() -> None:
    found, chain = chain_of(SHARED)
    diagnosis = DeviceMonitor(found, chain)
    for second in range(WINDOW):
        frame = RawFrame("line", second, second * SECOND_NS, b"W1.5\r\nR0.0\r\n")
        diagnosis.feed(frame)
        chain.feed(frame)
        health = diagnosis.devices(second * SECOND_NS)
    assert {name: device.state for name, device in health.items()} == {
        "wind": LinkState.GOOD,
        "rain": LinkState.GOOD,
    }
    assert health["wind"].skipped == {"no_beginning": 5, "other_line": 8 * 5}


def test_behind_a_gap_the_end_of_a_lost_signal_is_no_range() -> None:
    """Of 130.00, which means that there is no return, the gap leaves 30.00."""
    _, chain = chain_of(LASER)
    before = chain.feed(RawFrame("line", 0, 0, b"\r12.00\r1")).measurements
    chain.reset_after_gap()
    after = chain.feed(RawFrame("line", 9, SECOND_NS, b"30.00\r11.00\r")).measurements
    assert [m.slant_range for _, m in before + after if isinstance(m, Range)] == [12.0, 11.0]
