"""Falsifications of what was measured: biased, scaled, of the other sign, with a sigma that is not its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import orjson

from fti.logger.reading.mcap_file import McapMessage
from tests.post.score.sabotage.falsification import (
    GLIDE_SLOPE,
    HEIGHT,
    HEIGHT_BELOW,
    INTEGRITY,
    LOCATION,
    MIN_VALID,
    POSITIONS,
    VERTICAL,
    Falsification,
    Sample,
    Target,
)
from tests.post.score.sabotage.message_edits import Forgery, Table

EARTH_M = 6.371e6
Change = Callable[[float], float]


@dataclass(frozen=True)
class _Attack:
    """Fields of some topics, each changed by the same function.

    least : values must be at least so far from zero, for a while, else the change would be smaller than the error
    """

    name: str
    topics: tuple[str, ...]
    fields: tuple[str, ...]
    change: Change
    why: str
    minimum: float = 0.0

    def as_falsification(self) -> Falsification:
        return Falsification(self.name, self.why, self._targets)

    def _targets(self, sample: Sample) -> Iterator[Target]:
        for topic in sample.outputs:
            if topic.startswith(self.topics):
                values = sample.values(topic)
                names = [name for name in self.fields if self._is_large(values.get(name, []))]
                if names:
                    yield Target(f"{topic} {','.join(names)}", self._edit(topic, names))

    def _is_large(self, values: Sequence[float]) -> bool:
        return sum(abs(value) >= self.minimum for value in values) >= MIN_VALID

    def _edit(self, topic: str, fields: Sequence[str]) -> Callable[[Forgery], None]:
        def change(table: Table, t: float) -> None:
            for name in fields:
                if isinstance(table.get(name), int | float):
                    table[name] = self.change(table[name])

        return lambda forgery: forgery.edit_tables("derived", [topic], change)


def _plus(by: float) -> Change:
    return lambda value: value + by


def _times(by: float) -> Change:
    return lambda value: value * by


ANGLES = ("roll", "pitch")
HEIGHTS = ("height_agl", "nearest")
SOLUTIONS = (*POSITIONS, VERTICAL)
STATED_SIGMA_REASON = "the error is many times the sigma that the output states"
NO_SIGMA = "where no sigma is stated, the accuracy that a scenario allows to an aided solution is a few metres"
DOT_RAD = 0.12 * math.radians(3.0)

BIASES = (
    _Attack(
        "position 50 m north", POSITIONS, ("lat",), _plus(50 / EARTH_M), f"{STATED_SIGMA_REASON} (2 m); {NO_SIGMA}"
    ),
    _Attack(
        "position 50 m east", POSITIONS, ("lon",), _plus(50 / EARTH_M / 0.8), f"{STATED_SIGMA_REASON} (2 m); {NO_SIGMA}"
    ),
    _Attack("position 1 degree north", POSITIONS, ("lat",), _plus(math.radians(1.0)), "it is 111 km wrong"),
    _Attack(
        "location 50 m north",
        (LOCATION,),
        ("latitude",),
        _plus(math.degrees(50 / EARTH_M)),
        f"{STATED_SIGMA_REASON}; {NO_SIGMA}",
    ),
    _Attack("location 30 m high", (LOCATION,), ("altitude",), _plus(30.0), f"{STATED_SIGMA_REASON}; {NO_SIGMA}"),
    _Attack("altitude 30 m", SOLUTIONS, ("alt",), _plus(30.0), f"{STATED_SIGMA_REASON} (2 to 4 m); {NO_SIGMA}"),
    _Attack("altitude 500 m", SOLUTIONS, ("alt",), _plus(500.0), "no altimeter of the aircraft agrees"),
    _Attack("height above ground 20 m", (HEIGHT,), HEIGHTS, _plus(20.0), f"{STATED_SIGMA_REASON} (0.1 to 3 m)"),
    _Attack("height above ground 50 m", (HEIGHT,), HEIGHTS, _plus(50.0), f"{STATED_SIGMA_REASON} (0.1 to 3 m)"),
    _Attack(
        "raw range 50 m", (HEIGHT,), ("raw",), _plus(50.0), "the beam meets the ground of the truth file elsewhere"
    ),
    _Attack(
        "height below the aircraft 20 m",
        (HEIGHT_BELOW,),
        ("height_agl",),
        _plus(20.0),
        f"{STATED_SIGMA_REASON} (0.1 to 4 m)",
    ),
    _Attack("velocity 5 m/s north", POSITIONS, ("vel_north",), _plus(5.0), "the sigma of a velocity is 0.1 to 0.5 m/s"),
    _Attack("velocity 5 m/s east", POSITIONS, ("vel_east",), _plus(5.0), "the sigma of a velocity is 0.1 to 0.5 m/s"),
    _Attack("velocity 5 m/s down", SOLUTIONS, ("vel_down",), _plus(5.0), "the sigma of a velocity is 0.1 to 0.5 m/s"),
    _Attack(
        "attitude 2 degrees", POSITIONS, ANGLES, _plus(math.radians(2.0)), "sensors of attitude have 0.1 to 0.5 degrees"
    ),
    _Attack(
        "heading 5 degrees",
        POSITIONS,
        ("heading",),
        _plus(math.radians(5.0)),
        "the sigma of a heading is 1 to 2 degrees",
    ),
    _Attack(
        "deviation one dot",
        (GLIDE_SLOPE,),
        ("deviation",),
        _plus(DOT_RAD),
        f"{STATED_SIGMA_REASON} far from the threshold",
    ),
    _Attack(
        "dots one dot", (GLIDE_SLOPE,), ("dots",), _plus(1.0), "dots are the deviation over 0.12 of the glide angle"
    ),
    _Attack("distance s 50 m", (GLIDE_SLOPE,), ("s",), _plus(50.0), "s is of the position, whose sigma is 2 m"),
    _Attack("offset y 50 m", (GLIDE_SLOPE,), ("y",), _plus(50.0), "y is of the position, whose sigma is 2 m"),
    _Attack("height above the path 50 m", (GLIDE_SLOPE,), ("dh",), _plus(50.0), f"{STATED_SIGMA_REASON} (1 to 7 m)"),
    _Attack("navigated height above the path 50 m", (GLIDE_SLOPE,), ("dh_nav",), _plus(50.0), NO_SIGMA),
    _Attack(
        "height error of the monitor 50 m", (INTEGRITY,), ("height_error",), _plus(50.0), f"{STATED_SIGMA_REASON} (5 m)"
    ),
)
SCALES = (
    _Attack("height in feet as metres", (HEIGHT,), HEIGHTS, _times(0.3048), "at 100 m it is 70 m wrong", 100.0),
    _Attack("height times 1.2", (HEIGHT,), HEIGHTS, _times(1.2), "at 100 m it is 20 m wrong", 100.0),
    _Attack("distance s times 1.1", (GLIDE_SLOPE,), ("s",), _times(1.1), "at 1 km it is 100 m wrong", 1000.0),
    _Attack("sign of the descent", SOLUTIONS, ("vel_down",), _times(-1.0), "twice the rate of descent is wrong", 2.0),
    _Attack("sign of the longitude", POSITIONS, ("lon",), _times(-1.0), "it is on the other side of the earth"),
    _Attack(
        "position in degrees as radians", POSITIONS, ("lat", "lon"), _times(180 / math.pi), "no latitude is 36 rad"
    ),
    _Attack(
        "sign of the roll", POSITIONS, ("roll",), _times(-1.0), "in a turn it is 20 degrees wrong", math.radians(10.0)
    ),
)
ALL = ("/nav/",)
SIGMAS = (
    "horizontal_sd", "vertical_sd", "vel_sd", "tilt_sd", "heading_sd", "vel_down_sd", "sd", "nearest_sd", "dh_sd",
    "height_error_sd",
)  # fmt: skip
#: Only their presence is checked; an optimistic one is detected by the errors of its quantity.
CLAIM = (
    "a sigma is positive, stated for each valid value, and the errors fit it: neither 5 times it nor a fortieth of it"
)


class _OfSigma:
    """Every sigma of an output in turn, but for some."""

    def __init__(self, change: Callable[[float], object], but: Sequence[str] = ()) -> None:
        self._change, self._but = change, but

    def targets(self, sample: Sample) -> Iterator[Target]:
        for topic in sample.outputs:
            for name in SIGMAS:
                if name not in self._but and sample.values(topic).get(name):
                    yield Target(f"{topic} {name}", self._edit(topic, name))

    def _edit(self, topic: str, name: str) -> Callable[[Forgery], None]:
        def change(table: Table, t: float) -> None:
            if isinstance(table.get(name), int | float):
                table[name] = self._change(table[name])

        return lambda forgery: forgery.edit_tables("derived", [topic], change)


def _not_a_number(sample: Sample) -> Iterator[Target]:
    """``NaN`` as Python's json writes it: no JSON."""
    for topic in sample.outputs:
        for name in SIGMAS:
            if sample.values(topic).get(name):
                yield Target(f"{topic} {name}", _nan_edit(topic, name))


def _nan_edit(topic: str, name: str) -> Callable[[Forgery], None]:
    def change(item: McapMessage) -> Iterable[McapMessage]:
        table = orjson.loads(item.data)
        if not isinstance(table.get(name), int | float):
            return [item]
        table[name] = "@"
        return [item._replace(data=orjson.dumps(table).replace(b'"@"', b"NaN"))]

    return lambda forgery: forgery.edit("derived", [topic], change)


#: Sigmas of which a fortieth covers the errors of an honest flight still: without one of the device 5 m are assumed.
WIDE = ("height_error_sd",)

VALUES: Sequence[Falsification] = (
    *(attack.as_falsification() for attack in (*BIASES, *SCALES)),
    Falsification("sigma divided by 40", CLAIM, _OfSigma(lambda sd: sd / 40, WIDE).targets),
    Falsification("sigma times 100", CLAIM, _OfSigma(lambda sd: sd * 100).targets),
    Falsification("sigma missing", CLAIM, _OfSigma(lambda sd: None).targets),
    Falsification("sigma zero", CLAIM, _OfSigma(lambda sd: 0.0).targets),
    Falsification("sigma negative", CLAIM, _OfSigma(lambda sd: -sd).targets),
    Falsification("sigma NaN", CLAIM, _not_a_number),
)
