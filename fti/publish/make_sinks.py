"""Makes the sinks of a configuration, each with its queue."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from fti.config import Publish
from fti.publish.message import SessionIdentity
from fti.publish.notices import Notify
from fti.publish.sink import Sink
from fti.publish.sink_queue import SinkQueue
from fti.publish.sinks.foxglove import FoxgloveSink
from fti.publish.sinks.gdl90 import Gdl90Sink
from fti.publish.sinks.mqtt import MqttSink
from fti.publish.sinks.zenoh import ZenohSink


@dataclass(frozen=True, slots=True)
class ConfiguredSink:
    """A sink with its queue.  name : of its table in ``[publish]``"""

    name: str
    sink: Sink
    queue: SinkQueue


def make_sinks(
    publish: Publish, identity: SessionIdentity, report: Callable[[str, str, str], None]
) -> list[ConfiguredSink]:
    """The configured sinks; none of them is open.

    report : reports an event by level, source and text, from the thread of a sink
    """
    sinks = _sinks(publish, identity, report)
    return [ConfiguredSink(name, sink, SinkQueue(sink.topics, rate)) for name, sink, rate in sinks]


def _sinks(
    publish: Publish, identity: SessionIdentity, report: Callable[[str, str, str], None]
) -> Iterator[tuple[str, Sink, float | None]]:
    """Name, sink, and largest rate of a topic [Hz]."""

    def notify(name: str) -> Notify:
        return lambda level, text: report(level, f"publish {name}", text)

    if table := publish.mqtt:
        yield "mqtt", MqttSink(table, identity), table.max_rate_hz
    if nmea := publish.nmea:
        from fti.publish.sinks.nmea import NmeaSink  # noqa: PLC0415 - numpy and PROJ: only where they are used

        yield "nmea", NmeaSink(nmea, notify("nmea")), nmea.rate_hz
    if gdl90 := publish.gdl90:
        yield "gdl90", Gdl90Sink(gdl90, identity, notify("gdl90")), gdl90.rate_hz
    if mavlink := publish.mavlink:
        from fti.publish.sinks.mavlink import MavlinkSink  # noqa: PLC0415 - see above

        yield "mavlink", MavlinkSink(mavlink, notify("mavlink")), mavlink.rate_hz
    if zenoh := publish.zenoh:
        yield "zenoh", ZenohSink(zenoh, identity), zenoh.max_rate_hz
    if foxglove := publish.foxglove:
        yield "foxglove", FoxgloveSink(foxglove, identity), foxglove.max_rate_hz
