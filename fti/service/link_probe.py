"""Probe every link of a configuration without recording: the state and hint that the daemon would show."""

from __future__ import annotations

import asyncio
import dataclasses
from collections.abc import Sequence
from typing import Any

from fti.clock import SystemClock, choose_epoch_ns
from fti.config import Config
from fti.devices import BoundDevice
from fti.links import Link, Sink, open_link, per_frame_sink
from fti.messages.frames import RawFrame
from fti.messages.tables import to_table
from fti.service.fault_guard import keep_running
from fti.service.navigation.decode_chain import Chain
from fti.service.navigation.device_monitor import DeviceMonitor
from fti.service.supervisor.health import merge_link

POLL_PERIOD_S = 0.5


async def probe_links(config: Config, devices: Sequence[BoundDevice], duration_s: float) -> dict[str, dict[str, Any]]:
    """Open every link for duration_s [s]; returns state, hint, frames and bytes per link.  Nothing is sent."""
    clock = SystemClock(choose_epoch_ns())
    chain = Chain(config, devices, None)
    device_monitor = DeviceMonitor(config, chain)

    def sink_for(name: str) -> Sink:
        def accept(data: bytes, t_rx_ns: int) -> None:
            frame = RawFrame(name, 0, t_rx_ns, data)
            device_monitor.feed(frame)
            chain.feed(frame)

        return per_frame_sink(accept)

    listen_only = [link.model_copy(update={"transmit": False}) for link in config.link]
    links = [open_link(link, clock, sink_for(link.name)) for link in listen_only]
    tasks = [asyncio.create_task(keep_running(k.name, k.run, lambda unit, error: None), name=k.name) for k in links]
    try:
        return await _watch(links, device_monitor, clock, duration_s)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _watch(
    links: Sequence[Link], device_monitor: DeviceMonitor, clock: SystemClock, duration_s: float
) -> dict[str, dict[str, Any]]:
    end = asyncio.get_running_loop().time() + duration_s
    while True:
        devices = to_table(device_monitor.devices(clock.now_ns()))
        if asyncio.get_running_loop().time() >= end:
            return {link.name: merge_link(link.name, _status_fields(link), devices) for link in links}
        await asyncio.sleep(POLL_PERIOD_S)


def _status_fields(link: Link) -> dict[str, Any]:
    status = dataclasses.asdict(link.status)
    return {key: status[key] for key in ("state", "hint", "frames", "bytes")}
