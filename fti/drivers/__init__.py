"""Drivers: bytes in, measurements out, and back again.  No input or output of their own, no clock, no threads.

A driver is a module of this package whose name does not begin with ``_``.  In this order it has:

    docstring        document, revision, section; the packet layout as a text table; what is open
    ``DOCUMENT``     the citation, one line
    ``MESSAGES``     {message name: what it carries}
    ``CARRIERS``     the kinds of link it can be on: "serial", "udp", "can"
    ``Options``      what the configuration may say (strict, frozen; ``fti.config.StrictModel``)
    ``make_decoder(options) -> Decoder``    bytes of the link to measurements; never raises on bad bytes
    ``make_encoder(options) -> Encoder``    measurements to bytes, for the emulator
    ``on_connect(options) -> [bytes]``      what a device must be told after every connect
    ``poll(options) -> (period_s, bytes) | None``   a question that must be repeated
    ``COMMANDS``     {command name: ``Command``}: what ``fti send`` can ask of the device
    ``command(name, args, options) -> bytes``    the bytes of a command; ValueError when it or an argument is unknown,
                                                 missing or out of range, saying what is allowed
    ``INERTIAL``     True where it gives specific force and turn rate; may be left out where not

Every byte that is fed is framed, held or counted as skipped:
``bytes_in == framed + held + sum(skipped.values())``.
A message carries the arrival time of its first byte.

A device's answer to a command comes out of the decoder as an ``Ack``.

Where frames are missing a fresh decoder goes on.  What it must know from before, it takes over: ``StatefulDecoder``.
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
from fti.types import Measurement


@dataclass(slots=True)
class Counters:
    """What became of the bytes of a decoder, and how many messages of each name came out.

    lost : messages that never came, as the rolling counters in the others show, by name
    """

    bytes_in: int = 0
    framed: int = 0
    held: int = 0
    skipped: Counter[str] = field(default_factory=Counter)
    messages: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True, slots=True)
class Command:
    """A command that a device takes.

    does : one line for people; arguments : {name: meaning, unit, range; and the default where it has one}
    answered : the device acknowledges it, so that silence means that it did not take it
    """

    does: str
    arguments: Mapping[str, str] = field(default_factory=dict)
    answered: bool = True


class Decoder(Protocol):
    """A stream decoder."""

    counters: Counters

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        """Take one read, datagram or CAN frame that arrived at t_rx_ns; return what is complete now."""


@runtime_checkable
class StatefulDecoder(Protocol):
    """A decoder whose device has told it what outlasts missing frames: calibration tables, say."""

    def copy_state(self, before: Any) -> None:
        """Take over what another decoder of the same device was told.  before : of the same class; asked before feed"""


class Encoder(Protocol):
    """The other end of the line, for the emulator.  Stateful: it may count frames."""

    def encode(self, measurement: Measurement) -> list[bytes]:
        """Bytes of the message(s) that carry this measurement; empty when no message is due yet or none carries it."""

    def respond(self, data: bytes) -> list[bytes]:
        """What the device answers to bytes from the daemon."""


class Driver(Protocol):
    """What a driver module offers."""

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
    """Names of the drivers there are, sorted."""
    return tuple(sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")))


def load(name: str) -> Driver:
    """The driver of that name.  Raises ValueError naming those that exist."""
    if name not in names():
        raise ValueError(f"no driver {name!r}; there are {', '.join(names())}")
    module: Driver = importlib.import_module(f"{__name__}.{name}")
    return module


def is_inertial(driver: Driver) -> bool:
    """Whether the filter of navigation can rest on a device of this driver."""
    return bool(getattr(driver, "INERTIAL", False))
