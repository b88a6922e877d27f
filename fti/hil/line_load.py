"""Does a line carry what its devices send?  Asked before the flight, with encoders of its own."""

from __future__ import annotations

from collections.abc import Iterable

from fti.config import CanLink, Config, Link, SerialLink
from fti.hil.ports.pacing import byte_s, frame_s
from fti.hil.sensors import SimulatedSensor

#: The rate of a device is taken from so many seconds of its samples, and at most so many samples.
SPAN_S, SAMPLES = 5.0, 200


def overloads(config: Config, sensors: Iterable[SimulatedSensor]) -> list[str]:
    """A sentence for each line that cannot carry what its devices send."""
    there = list(sensors)
    found = ((link, _share(link, [s for s in there if s.link == link.name])) for link in config.link)
    return [_sentence(link, share) for link, share in found if share > 1.0]


def _share(link: Link, sensors: list[SimulatedSensor]) -> float:
    """How much of the time of a line its devices take; 1 : all of it."""
    return sum(_duration_s(link, message) * per_s for sensor in sensors for message, per_s in _messages(sensor))


def _messages(sensor: SimulatedSensor) -> list[tuple[bytes, float]]:
    """Messages of the begin of the flight, each with how often it comes [1/s]."""
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


def _sentence(link: Link, share: float) -> str:
    if isinstance(link, SerialLink):
        carried = 1.0 / byte_s(link)
        what = f"{link.baud} baud carry {carried:.0f} bytes a second, its devices send {share * carried:.0f}"
    else:
        what = f"its devices send {100 * share:.0f} % of what the bus carries"
    return f"{link.name}: {what}; the oldest messages will be dropped"
