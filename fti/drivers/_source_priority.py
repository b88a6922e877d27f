"""Priority of sources: selects one message where several messages of a device carry the same quantity.

A measurement does not identify its message.  A consumer must therefore get one source of each quantity of a device, for
example either the position of the system or that of the antenna.  Measurements of other messages become Readings
with the names of message and field, so that no data are lost or mixed.

1. A message with a higher priority becomes the source as soon as it is valid.
2. A message with a lower priority becomes the source after no higher one was valid for five seconds.
3. While none is valid, the last source remains, and reports that it is not valid.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from fti.messages.measurements import Measurement, RadioHeight, Range, Reading

#: Quantity -> priority of a message among those that carry it, 0: highest.
Ranks = Mapping[type, int]
#: A source keeps its priority for this time after its last valid message [ns].
SOURCE_TIMEOUT_NS = 5_000_000_000

HEIGHTS = ("slant_range", "height_agl")
UNITS = {
    "rad": ("lat", "lon", "track"),
    "m": ("alt", "alt_msl", "undulation", "horizontal_sd", "vertical_sd", "alt_press", *HEIGHTS),
    "m/s": ("north", "east", "down", "ground_speed", "sd"),
    "m/s^2": ("accel_b",),
    "rad/s": ("gyro_b",),
}
UNIT_OF = {name: unit for unit, names in UNITS.items() for name in names}


@dataclass(slots=True)
class ActiveSource:
    """The present source: rank, last arrival, last valid arrival (None: never) [ns]."""

    rank: int
    received_ns: int
    valid_ns: int | None = None


def ranks_of(preferred: Mapping[type, tuple[tuple[str, ...], ...]]) -> dict[str, dict[type, int]]:
    """Message -> ranks.

    preferred : groups of messages that carry a quantity, highest priority first; a group has one source
    """
    ranks: dict[str, dict[type, int]] = {}
    for kind, lines in preferred.items():
        for rank, names in enumerate(lines):
            for name in names:
                ranks.setdefault(name, {})[kind] = rank
    return ranks


class SourcePriority:
    """Keeps the present source of each quantity.  Range and RadioHeight count as one quantity."""

    def __init__(self) -> None:
        self._sources: dict[type, ActiveSource] = {}

    def select(self, name: str, ranks: Ranks, measurements: list[Measurement]) -> list[Measurement]:
        """The measurements of a message; those of other sources converted to Readings."""
        out: list[Measurement] = []
        for m in measurements:
            rank = ranks.get(type(m))
            if rank is None or self._is_active(rank, m):
                out.append(m)
            else:
                out += to_readings(name.lower(), m)
        return out

    def _is_active(self, rank: int, m: Measurement) -> bool:
        now, valid = m.stamp.t_rx_ns, getattr(m, "valid", True)
        quantity = Range if isinstance(m, RadioHeight) else type(m)
        source = self._sources.get(quantity)
        if source is None or source.rank != rank:
            if source and not _takes_over(rank, valid, now, source):
                return False
            source = self._sources[quantity] = ActiveSource(rank, now)
        source.received_ns = now
        if valid:
            source.valid_ns = now
        return True


def _takes_over(rank: int, valid: bool, now: int, source: ActiveSource) -> bool:
    """Does a message of another rank become the source?"""
    if valid and rank < source.rank:
        return True
    since = source.valid_ns if valid else source.received_ns
    return since is None or not 0 <= now - since <= SOURCE_TIMEOUT_NS


def to_readings(prefix: str, measurement: Measurement) -> Iterator[Reading]:
    """Every number of a measurement, as ``prefix_field``; of a vector, as ``prefix_field_x`` and so on."""
    valid = getattr(measurement, "valid", True)
    for field in measurement.__struct_fields__:
        if (unit := UNIT_OF.get(field)) is None:
            continue
        value = getattr(measurement, field)
        parts = zip(("_x", "_y", "_z"), value, strict=True) if isinstance(value, tuple) else [("", value)]
        for axis, number in parts:
            if number is not None:
                name = f"{prefix}_{field}{axis}"
                yield Reading(stamp=measurement.stamp, name=name, value=number, unit=unit, valid=valid)
