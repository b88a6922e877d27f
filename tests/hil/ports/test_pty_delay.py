"""Late bytes of the kernel are reported, with a clock that the test advances."""

from __future__ import annotations

import asyncio

from fti.clock import FakeClock
from fti.hil.ports.pty_delay import PtyDelay

SECOND_NS = 1_000_000_000


async def arrived(probe: PtyDelay) -> None:
    """Let the kernel carry what was sent."""
    for _ in range(500):
        if not probe._sent:
            return
        await asyncio.sleep(0.01)
    raise AssertionError("no byte came through the pty")


async def test_only_a_byte_that_arrives_late_is_reported() -> None:
    clock, delays = FakeClock(7 * SECOND_NS), list[tuple[int, int]]()
    with PtyDelay(clock.now_ns, 1.0, lambda from_ns, until_ns: delays.append((from_ns, until_ns))) as probe:
        await probe.send()
        await arrived(probe)
        assert delays == []
        await probe.send()
        clock.time_ns += SECOND_NS // 2
        await arrived(probe)
        assert delays == [(7 * SECOND_NS, 7 * SECOND_NS + SECOND_NS // 2)]


async def test_a_byte_that_has_not_arrived_at_the_end_is_reported() -> None:
    clock, delays = FakeClock(0), list[tuple[int, int]]()
    with PtyDelay(clock.now_ns, 1.0, lambda from_ns, until_ns: delays.append((from_ns, until_ns))) as probe:
        asyncio.get_running_loop().remove_reader(probe._slave)
        await probe.send()
        clock.time_ns += SECOND_NS
    assert delays == [(0, SECOND_NS)]


async def test_it_beats_until_the_flight_ends() -> None:
    with PtyDelay(FakeClock(0).now_ns, 0.1, lambda from_ns, until_ns: None) as probe:
        due = [probe.due_s()]
        while due[-1] is not None:
            await probe.send()
            due.append(probe.due_s())
    assert due == [0.0, 0.04, 0.08, None]
