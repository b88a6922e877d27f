"""Drivers: convert bytes to measurements and back.  No input or output of their own, no clock, no threads.

A driver is a module of this package whose name does not begin with ``_``.  In this order it has:

    docstring        document, revision, section; packet layout as a text table; open points
    ``DOCUMENT``     the citation, one line
    ``MESSAGES``     {message name: contents}
    ``CARRIERS``     the supported kinds of link: "serial", "udp", "can"
    ``Options``      options of the configuration (strict, frozen; ``fti.config.StrictModel``)
    ``make_decoder(options) -> Decoder``    bytes of the link to measurements; never raises on bad bytes
    ``make_encoder(options) -> Encoder``    measurements to bytes, for the emulator; both raise ValueError for wrong
                                            options
    ``on_connect(options) -> [bytes]``      messages to the device after every connect
    ``poll(options) -> (period_s, bytes) | None``   a request that is sent periodically
    ``COMMANDS``     {command name: ``Command``}: the commands for ``fti send``
    ``command(name, args, options) -> bytes``    the bytes of a command; ValueError with the allowed values if it or an
                                                 argument is unknown, missing or out of range
    ``INERTIAL``     True if it gives specific force and angular rate; otherwise optional
    ``BEAMS``        True if it gives ranges along several beams; otherwise optional
    ``SCANS``        True if it gives scans of a scanner that turns; otherwise optional

Every input byte is framed, held or counted as skipped:
``bytes_in == framed + held + sum(skipped.values())``.
A message carries the arrival time of its first byte.

The decoder converts the answer of a device to a command to an ``Ack``.

After missing frames a new decoder continues.  It copies the state that must persist: ``StatefulDecoder``.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Protocol, runtime_checkable

from fti.config import StrictModel
from fti.errors import did_you_mean
from fti.messages.measurements import Measurement


@dataclass(slots=True)
class Counters:
    """Bytes of a decoder by result, and numbers of messages by name.

    lost : missing messages by name, from rolling counters
    """

    bytes_in: int = 0
    framed: int = 0
    held: int = 0
    skipped: Counter[str] = field(default_factory=Counter)
    messages: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True, slots=True)
class Command:
    """A command of a device.

    does : description in one line; arguments : {name: meaning, unit, range, default if there is one}
    answered : the device acknowledges it, so that silence means a failure
    """

    does: str
    arguments: Mapping[str, str] = field(default_factory=dict)
    answered: bool = True


class Decoder(Protocol):
    """A stream decoder."""

    counters: Counters

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        """Decode one read, datagram or CAN frame that arrived at t_rx_ns; returns the completed measurements."""


@runtime_checkable
class StatefulDecoder(Protocol):
    """A decoder with state that must outlast missing frames, such as calibration tables."""

    def copy_state(self, previous: Any) -> None:
        """Copy the state of another decoder of the same device and class; called before ``feed``."""


class Encoder(Protocol):
    """The emulated device.  Stateful: it may count frames."""

    def encode(self, measurement: Measurement) -> list[bytes]:
        """Messages that carry this measurement; empty when no message is due or none carries it."""

    def respond(self, data: bytes) -> list[bytes]:
        """Answers of the device to bytes from the daemon."""


class Driver(Protocol):
    """Interface of a driver module.

    A module whose device also sends when nothing was requested has ``SENDS_UNASKED = True``.
    """

    DOCUMENT: str
    MESSAGES: Mapping[str, str]
    CARRIERS: frozenset[str]
    COMMANDS: Mapping[str, Command]
    Options: type[StrictModel]

    def make_decoder(self, options: StrictModel) -> Decoder: ...

    def make_encoder(self, options: StrictModel) -> Encoder: ...

    def on_connect(self, options: StrictModel) -> Sequence[bytes]: ...

    def poll(self, options: StrictModel) -> tuple[float, bytes] | None: ...

    def command(self, name: str, args: Mapping[str, str], options: StrictModel | None = None) -> bytes: ...


@cache
def names() -> tuple[str, ...]:
    """Names of all drivers, sorted."""
    return tuple(sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")))


def load(name: str) -> Driver:
    """The driver of that name.  Raises ValueError with the existing names."""
    if name not in names():
        raise ValueError(f"no driver {name!r}; there are {', '.join(names())}{did_you_mean(name, names())}")
    module: Driver = importlib.import_module(f"{__name__}.{name}")
    return module


def has_beams(driver: Driver) -> bool:
    """Does the driver provide ranges along several beams?"""
    return bool(getattr(driver, "BEAMS", False))


def has_turns(driver: Driver) -> bool:
    """Does the driver provide scans of a scanner that turns, each of which is a part of a turn?"""
    return bool(getattr(driver, "SCANS", False))


def is_inertial(driver: Driver) -> bool:
    """Does the driver provide inertial samples for the navigation filter?"""
    return bool(getattr(driver, "INERTIAL", False))
