"""Check before the flight whether each line has the capacity for the messages of its devices."""

from __future__ import annotations

from collections.abc import Iterable

from fti.config import CanLink, Config, Link, SerialLink
from fti.hil.ports.pacing import byte_s, frame_s
from fti.hil.sensors import SimulatedSensor

#: Duration [s] and largest number of the samples from which the load of a device is computed.
SPAN_S, SAMPLES = 5.0, 200


def overloads(config: Config, sensors: Iterable[SimulatedSensor]) -> list[str]:
    """A warning for each line whose devices exceed its capacity."""
    found, every = [], list(sensors)
    for link in config.link:
        messages = [message for sensor in every if sensor.link == link.name for message in _messages(sensor)]
        share = sum(_duration_s(link, message) * per_s for message, per_s in messages)
        if share <= 1.0:
            continue
        load = f"its devices send {100 * share:.0f} % of the capacity of the bus"
        if isinstance(link, SerialLink):
            capacity = 1.0 / byte_s(link)
            load = f"{link.baud} baud carry {capacity:.0f} bytes a second, its devices send {share * capacity:.0f}"
        found.append(f"{link.name}: {load}; the oldest messages will be dropped")
    return found


def _messages(sensor: SimulatedSensor) -> list[tuple[bytes, float]]:
    """Messages at the beginning of the flight, each with its rate [1/s]."""
    encoder = sensor.bound.driver.make_encoder(sensor.bound.options)
    count = min(len(sensor.t), SAMPLES, max(1, round(SPAN_S * sensor.rate_hz)))
    encoded = [message for k in range(count) for m in sensor.measure(k, 0) for message in encoder.encode(m)]
    return [(message, sensor.rate_hz / count) for message in encoded]


def _duration_s(link: Link, message: bytes) -> float:
    if isinstance(link, SerialLink):
        return len(message) * byte_s(link)
    if isinstance(link, CanLink) and link.bitrate:
        return frame_s(message, link.bitrate)
    return 0.0
