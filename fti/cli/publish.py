"""Send the outputs of a recorded session to other programs, with the recorded timing.

The sinks are those of [publish] in CONFIG: MQTT, zenoh, Foxglove, NMEA and so on (docs/publish.md).  Use it to try a
ground station, a map or a dashboard in the laboratory, or to show a flight again.  Outputs, health, alarms and events
are sent as the daemon had sent them; times in the messages are those of the recording, and health has the origin
"replay".  Nothing is computed again: fti replay and fti run do that.

It begins when every sink is connected, or after ten seconds.  On exit it prints what each sink has sent.  Exit code 1:
a sink was never connected, or has lost an event.

  fti publish data/demo_20260101T120000Z_0 --config configs/demo.toml
  fti publish data/demo_20260101T120000Z_0 --config ground.toml --from 120 --speed 4
"""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING, Any

from fti.cli._arguments import factor, seconds
from fti.cli._printing import print_json, print_line, print_lines
from fti.cli.main import EXIT_INTERRUPTED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from fti.config import Config
    from fti.logger.reading.recording import Recording
    from fti.messages.health import SinkHealth
    from fti.post.recorded_bus import RecordedMessage
    from fti.publish.fan_out import FanOut
    from fti.service.publish.sink_worker import SinkWorker

CONNECT_TIMEOUT_S = 10.0
POLL_S = 0.02
#: Period of the shown progress [s].
SHOW_PERIOD_S = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti publish``."""
    parser.add_argument("session", metavar="SESSION", help="folder of a session, or one of its files")
    parser.add_argument("--config", metavar="CONFIG", required=True, help="configuration with [publish]")
    parser.add_argument("--speed", type=factor, default=1.0, metavar="X", help="speed factor (default: 1)")
    parser.add_argument("--from", type=seconds, default=0.0, dest="from_s", metavar="T", help="skip the first T s")
    parser.add_argument("--loop", action="store_true", help="repeat until interrupted")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")


def run(args: argparse.Namespace) -> int:
    """Send the session; 1 when a sink was never connected or has lost an event."""
    from pathlib import Path

    from fti import config as configuration
    from fti.cli._read_report import report_faults, report_remarks
    from fti.errors import ConfigError, MissingError
    from fti.logger.reading.recording import Recording

    config = configuration.load(args.config)
    if config.publish is None:
        raise ConfigError(f"{args.config}: publish: is missing; fti publish needs [publish] with at least one sink")
    if not any(table for name, table in config.publish if name != "aircraft"):
        raise ConfigError(f"{args.config}: publish: has no sink; fti publish needs at least one: [publish.mqtt] ...")
    recording = Recording.open(Path(args.session))
    report_remarks(recording)
    if not recording.paths("derived"):
        raise MissingError(f"{args.session}: has no outputs (derived files); fti reprocess computes them")
    was_interrupted, results = _publish(args, config, recording)
    report_faults(recording)
    print_json(_as_json(results)) if args.json else print_lines(_as_text(results))
    if was_interrupted:
        return EXIT_INTERRUPTED
    return int(any(not sink.connects or sink.lost_events for sink in results.values()))


def _publish(args: argparse.Namespace, config: Config, recording: Recording) -> tuple[bool, dict[str, SinkHealth]]:
    """Send the session to all sinks; was it interrupted?"""
    from fti.publish.fan_out import FanOut
    from fti.publish.make_sinks import make_sinks
    from fti.publish.message import SessionIdentity
    from fti.service.publish.sink_worker import SinkWorker, end_workers

    assert config.publish is not None
    aircraft = config.publish.aircraft or recording.session.partition("_")[0]
    sinks = make_sinks(config.publish, SessionIdentity(aircraft, recording.session), _print_event)
    workers = [SinkWorker(sink.name, sink.sink, sink.queue, _print_event) for sink in sinks]
    for worker in workers:
        worker.start()
    was_interrupted = False
    try:
        _wait_for_connections(workers)
        _send(args, recording, FanOut(sink.queue for sink in sinks))
        _wait_for_queues(workers)
    except KeyboardInterrupt:
        was_interrupted = True
    finally:
        end_workers(workers)
    return was_interrupted, {worker.name: worker.health() for worker in workers}


def _print_event(level: str, source: str, text: str) -> None:
    print_line(f"{level}: {source}: {text}", error=True, flush=True)


def _wait_for_connections(workers: list[SinkWorker]) -> None:
    _wait(lambda: all(worker.health().connects for worker in workers))


def _wait_for_queues(workers: list[SinkWorker]) -> None:
    _wait(lambda: all(not worker.health().waiting_events for worker in workers if worker.health().connects))


def _wait(is_met: Callable[[], bool]) -> None:
    end_s = time.monotonic() + CONNECT_TIMEOUT_S
    while not is_met() and time.monotonic() < end_s:
        time.sleep(POLL_S)


def _send(args: argparse.Namespace, recording: Recording, fan_out: FanOut) -> None:
    """Give every message to the sinks at its time."""
    from fti.cli._progress import show_progress
    from fti.constants import SECOND_NS
    from fti.errors import MissingError
    from fti.hil.replay import length_s

    duration_s = length_s(recording)
    with show_progress(f"publish {recording.session}") as show:
        is_first = True
        while args.loop or is_first:
            is_first = False
            begin_ns, begin_s, shown_s = None, time.monotonic(), 0.0
            for message in _messages(args, recording):
                begin_ns = message.t_ns if begin_ns is None else begin_ns
                recorded_s = (message.t_ns - begin_ns) / SECOND_NS
                wait_s = begin_s + recorded_s / args.speed - time.monotonic()
                if wait_s > 0.0:
                    time.sleep(wait_s)
                fan_out.publish(message.topic, message.payload)
                if duration_s and time.monotonic() - shown_s > SHOW_PERIOD_S:
                    shown_s = time.monotonic()
                    show(f"publish {recording.session}", min(1.0, (args.from_s + recorded_s) / duration_s))
            if begin_ns is None:
                raise MissingError(f"{args.session}: has no messages after --from {args.from_s:g} s")


def _messages(args: argparse.Namespace, recording: Recording) -> Iterator[RecordedMessage]:
    """The messages from the requested time on."""
    from fti.constants import SECOND_NS
    from fti.errors import ConfigError, MissingError
    from fti.hil.session_config import recorded_config
    from fti.post.recorded_bus import RecordedBus

    try:
        config = recorded_config(recording, recording.path)
    except (ConfigError, MissingError):  # the largest ages of heights are then the common one
        config = None
    begin_ns = None
    for message in RecordedBus(recording, config).messages():
        begin_ns = message.t_ns if begin_ns is None else begin_ns
        if message.t_ns - begin_ns >= args.from_s * SECOND_NS:
            yield message


def _as_json(results: dict[str, SinkHealth]) -> dict[str, Any]:
    from fti.messages.tables import to_table

    return {"sinks": {name: to_table(sink) for name, sink in results.items()}}


def _as_text(results: dict[str, SinkHealth]) -> Iterator[str]:
    for name, sink in results.items():
        if not sink.connects:
            yield f"{name}: never connected: {sink.hint}"
            continue
        counts = {"sent": sink.sent, "replaced": sink.replaced, "left out by the rate": sink.skipped}
        lost = f", {sink.lost_events} events lost" if sink.lost_events else ""
        yield f"{name}: " + ", ".join(f"{count} {what}" for what, count in counts.items()) + lost
