"""What ``fti hil`` and ``fti replay`` share: hold the folder, run until the end or a signal, say when ready, report."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import json
import os
import signal
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path

from fti.cli._printing import print_line
from fti.errors import MissingError
from fti.hil.report import TransmissionReport
from fti.latency_histogram import LatencySummary
from fti.service.private_folder import check_trusted

#: Each ends the playing in good order; the last one is a terminal that is closed.
END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextlib.contextmanager
def claim_ports(folder: Path) -> Iterator[None]:
    """The folder is ours while the block lasts; told when another emulator or replay has its ports there.

    Raises MissingError when another user has made it or can write to it: the ports would be whatever he puts there.
    """
    check_trusted(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o755)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:  # what a port needs of it, the port says
        yield
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        print_notice(
            f"{folder}: another fti hil or fti replay has its ports there; those of the same name are taken from it"
        )
    try:
        yield
    finally:
        os.close(descriptor)


async def run_until_stopped(
    play: Callable[[asyncio.Event], Awaitable[TransmissionReport]], ready: asyncio.Event
) -> tuple[TransmissionReport, bool]:
    """Run ``play(stop)``; print "ready" when the ports exist.  Returns the report, and whether a signal ended it."""
    stop, signals = asyncio.Event(), list[int]()

    def interrupted(number: int) -> None:
        signals.append(number)
        stop.set()

    loop = asyncio.get_running_loop()
    for name in END_SIGNALS:
        loop.add_signal_handler(name, interrupted, name)
    announcing = asyncio.create_task(_announce(ready), name="fti-hil-ready")
    try:
        report = await play(stop)
    finally:
        announcing.cancel()
    return report, bool(signals)


async def _announce(ready: asyncio.Event) -> None:
    await ready.wait()
    print_line("ready", flush=True)


def print_notice(news: str) -> None:
    """Say something to the person at the bench."""
    print_line(news, error=True, flush=True)


def print_report(report: TransmissionReport) -> None:
    """What was sent on each link, what was lost, how late it was, and which rates may not be claimed."""
    for name, sent in sorted(report.links.items()):
        lost = (
            f", {sent.dropped_messages} dropped ({_loss_reason(sent.too_slow_messages)})"
            if sent.dropped_messages
            else ""
        )
        late = f"; late by {_lateness_text(report.link_lateness[name])}" if name in report.link_lateness else ""
        print_line(f"{name:20} {sent.messages} messages, {sent.bytes} bytes{lost}{late}")
    for rate in report.rates:
        sent_hz = "-" if rate.sent_hz is None else f"{rate.sent_hz:.2f}"
        print_line(
            f"{rate.name:20} {rate.asked_hz:g} Hz asked for, {sent_hz} Hz sent, held: {_held_text(report, rate.name)}"
        )
    for why in report.problems:
        print_line(f"not held: {why}")
    print_line(f"lateness of {report.lateness.messages} messages: {_lateness_text(report.lateness)}")


def _loss_reason(too_slow: int) -> str:
    return f"the line was too slow for {too_slow}" if too_slow else "nobody read"


def _held_text(report: TransmissionReport, device: str) -> str:
    return "no" if any(why.startswith(f"{device}: ") for why in report.problems) else "yes"


def _lateness_text(late: LatencySummary) -> str:
    return f"p50 {late.p50_ms:.2f}, p99 {late.p99_ms:.2f}, max {late.max_ms:.2f} ms"


def write_report(report: TransmissionReport, path: str | None) -> None:
    """The report as JSON, where a path is given.  Raises MissingError when it cannot be written."""
    _write(path, json.dumps(report.as_json(), indent=1) + "\n", mode="w")


def check_report(path: str | None) -> None:
    """Asked before a flight of an hour.  Raises MissingError when no report can be written there."""
    _write(path, "", mode="a")


def _write(path: str | None, text: str, mode: str) -> None:
    if path is None:
        return
    try:
        with Path(path).open(mode, encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise MissingError(f"{path}: cannot be written: {error.strerror}") from None
