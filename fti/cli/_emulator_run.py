"""Shared by ``fti hil`` and ``fti replay``: claim the port folder, run until the end or a signal, print the report."""

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
from fti.private_folder import check_trusted

#: Signals that stop an emulator or replay in good order; SIGHUP: the terminal was closed.
END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextlib.contextmanager
def claim_ports(folder: Path) -> Iterator[None]:
    """Lock the folder while the block lasts; print a notice when another emulator or replay has its ports there.

    Raises MissingError when another user owns it or can write to it: he could replace the ports.
    """
    check_trusted(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o755)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:  # opening a port reports the error
        yield
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        print_notice(
            f"{folder}: another fti hil or fti replay uses this folder; its ports of the same names are replaced"
        )
    try:
        yield
    finally:
        os.close(descriptor)


async def run_until_stopped(
    play: Callable[[asyncio.Event], Awaitable[TransmissionReport]], ready: asyncio.Event
) -> tuple[TransmissionReport, bool]:
    """Run ``play(stop)``; print "ready" when the ports exist.  Returns the report; True when a signal ended it."""
    stop, signals = asyncio.Event(), list[int]()

    def on_signal(number: int) -> None:
        signals.append(number)
        stop.set()

    loop = asyncio.get_running_loop()
    for name in END_SIGNALS:
        loop.add_signal_handler(name, on_signal, name)
    announcement = asyncio.create_task(_announce(ready), name="fti-hil-ready")
    try:
        report = await play(stop)
    finally:
        announcement.cancel()
    return report, bool(signals)


async def _announce(ready: asyncio.Event) -> None:
    await ready.wait()
    print_line("ready", flush=True)


def print_notice(text: str) -> None:
    """Print a notice for the operator on standard error."""
    print_line(text, error=True, flush=True)


def print_report(report: TransmissionReport) -> None:
    """Print sent and dropped messages and lateness of each link, and whether each device held its rate."""
    for name, link in sorted(report.links.items()):
        reason = f"the line was too slow for {link.too_slow_messages}" if link.too_slow_messages else "no reader"
        dropped = f", {link.dropped_messages} dropped ({reason})" if link.dropped_messages else ""
        late = f"; late by {_lateness_text(report.link_lateness[name])}" if name in report.link_lateness else ""
        print_line(f"{name:20} {link.messages} messages, {link.bytes} bytes{dropped}{late}")
    for rate in report.rates:
        sent_hz = "-" if rate.sent_hz is None else f"{rate.sent_hz:.2f}"
        held = "no" if any(problem.startswith(f"{rate.name}: ") for problem in report.problems) else "yes"
        print_line(f"{rate.name:20} {rate.asked_hz:g} Hz requested, {sent_hz} Hz sent, held: {held}")
    for problem in report.problems:
        print_line(f"not held: {problem}")
    print_line(f"lateness of {report.lateness.messages} messages: {_lateness_text(report.lateness)}")


def _lateness_text(late: LatencySummary) -> str:
    return f"p50 {late.p50_ms:.2f}, p99 {late.p99_ms:.2f}, max {late.max_ms:.2f} ms"


def write_report(report: TransmissionReport, path: str | None) -> None:
    """Write the report as JSON if there is a path.  Raises MissingError when it cannot be written."""
    _write(path, json.dumps(report.as_json(), indent=1) + "\n", mode="w")


def check_report(path: str | None) -> None:
    """Check before the flight that the report can be written.  Raises MissingError."""
    _write(path, "", mode="a")


def _write(path: str | None, text: str, mode: str) -> None:
    if path is None:
        return
    try:
        with Path(path).open(mode, encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise MissingError(f"{path}: cannot be written: {error.strerror}") from None
