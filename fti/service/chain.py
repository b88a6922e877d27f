"""The chain: raw frames in, measurements and outputs out.  Live navigation and reprocessing run this same object.

It is deterministic: it knows no time but the stamps and ticks of the frames, and takes them in order of ``seq``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from fti.alarms.condition import Report
from fti.config import Config
from fti.drivers import Counters, Decoder, Remembering
from fti.logger.schemas import ALARM_REPORT_TOPIC, DEVICE_CLOCK_TOPIC, READMISSION_TOPIC, TERRAIN_TOPIC
from fti.nav.alarm_conditions import OutputConditions
from fti.nav.carried_refusal import CarriedRefusal
from fti.nav.ground import Ground
from fti.nav.integrity.reference import Reference
from fti.nav.mounted import Mountings
from fti.nav.pipeline import Pipeline
from fti.nav.times.device_times import DeviceTimes
from fti.service.binding import BoundDevice
from fti.service.guard import Guard
from fti.types import ALL_SOURCES, TICK_LINK, Event, Measurement, Output, RawFrame

#: Why bytes are no frame that a decoder held when frames went missing, or had when it failed.
GAP, FAILURE = "gap", "failure"


@dataclass(slots=True)
class Products:
    """What came out of some frames, in order."""

    measurements: list[tuple[str, Measurement]] = field(default_factory=list)
    outputs: list[Output | Event] = field(default_factory=list)
    notes: list[tuple[str, int, dict[str, Any]]] = field(default_factory=list)  # topic, time [ns], content


@dataclass(slots=True)
class Listener:
    """A device on its link: its decoder and what it has heard."""

    bound: BoundDevice
    decoder: Decoder
    messages: int = 0
    last_ns: int | None = None
    name: str = field(init=False)  # of the device

    def __post_init__(self) -> None:
        self.name = self.bound.device.name

    def start_afresh(self, reason: str) -> None:
        """Another decoder goes on; what this one had begun with is skipped for that reason."""
        before = self.decoder
        self.decoder = self.bound.make_decoder()
        _go_on(self.decoder.counters, before.counters, reason)
        if isinstance(self.decoder, Remembering):
            self.decoder.remember(before)


class Chain:
    """Decoders of all links and the navigation pipeline behind them."""

    def __init__(self, config: Config, devices: Sequence[BoundDevice], reference: Reference | None) -> None:
        self.listeners = [Listener(bound, bound.make_decoder()) for bound in devices]
        self._on_link: dict[str, list[Listener]] = {}
        for listener in self.listeners:
            self._on_link.setdefault(listener.bound.device.link, []).append(listener)
        self._times, self._mountings = DeviceTimes(config.device), Mountings(config.device)
        self._config, self._reference = config, reference
        self._pipeline, self._conditions = Pipeline(config, reference), OutputConditions(config)
        self._given_ground: tuple[Ground | None] | None = None  # none was given yet

    def pass_gap(self) -> None:
        """Frames are missing before the next one: what decoders hold is no beginning of it, so they start afresh."""
        for listener in self.listeners:
            listener.start_afresh(GAP)
        self._pipeline.pass_gap()

    def give_ground(self, ground: Ground | None, fault: str | None, after_seq: int, t_ns: int) -> Products:
        """Behind frame ``after_seq`` at t_ns the ground was there; None: it never will be, and ``fault`` says why."""
        products = Products()
        self._given_ground = (ground,)
        self._pipeline.give_ground(ground)
        about: dict[str, Any] = {"fault": fault or ""}
        if ground:
            about = {"name": ground.name, "files": ground.files, "sha256": ground.digest}
        products.notes.append((TERRAIN_TOPIC, t_ns, {"t_ns": t_ns, "after_seq": after_seq, **about}))
        products.notes.append(_alarm_note(self._conditions.judge_ground(t_ns, fault)))
        level, text = ("info", ground.name) if ground else ("error", f"there is none: {fault}")
        products.outputs.append(Event(t_ns=t_ns, level=level, source="terrain", text=text))
        return products

    def readmit(self, source: str, after_seq: int, t_ns: int) -> Products:
        """Behind frame ``after_seq`` at t_ns the operator has confirmed a source, or all.  Raises KeyError."""
        products = Products()
        if source == ALL_SOURCES:
            products.notes += map(_alarm_note, self._conditions.end_all(t_ns))
            products.outputs.append(self._begin_anew(t_ns))
        else:
            products.outputs += self._pipeline.readmit(source, t_ns)
        products.notes.append((READMISSION_TOPIC, t_ns, {"t_ns": t_ns, "after_seq": after_seq, "source": source}))
        return products

    def _begin_anew(self, t_ns: int) -> Event:
        """Discard all earlier measurements, the state of the filter, all refusals, and the device clocks."""
        self._times = DeviceTimes(self._config.device)
        self._pipeline, self._conditions = Pipeline(self._config, self._reference), OutputConditions(self._config)
        if self._given_ground:
            self._pipeline.give_ground(*self._given_ground)
        text = "begins anew: the operator readmits all sources"
        return Event(t_ns=t_ns, level="info", source="nav", text=text)

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Of sources, in force."""
        return self._pipeline.refusals

    def restore(self, refusals: Sequence[CarriedRefusal], t_ns: int) -> Products:
        """Begin with what the process before had refused, at the time of the first frame."""
        return Products(outputs=[*self._pipeline.restore(refusals, t_ns)])

    def feed(self, frame: RawFrame) -> Products:
        """Take the next frame; return what follows from it."""
        products = Products()
        if frame.link == TICK_LINK:
            with _Telling("pipeline", frame, products):
                products.outputs += self._pipeline.tick(frame.t_rx_ns)
            with _Telling("device clocks", frame, products):
                self._tell_times(frame.t_rx_ns, products)
        for listener in self._on_link.get(frame.link, ()):
            if found := self._decode(listener, frame, products):
                self._navigate(listener.name, found, frame, products)
        if products.outputs:  # of most frames there are none
            self._report_conditions(frame, products)
        return products

    def _report_conditions(self, frame: RawFrame, products: Products) -> None:
        with _Telling("alarm conditions", frame, products):
            products.notes += map(_alarm_note, self._conditions.take(products.outputs))

    def _navigate(self, device: str, found: list[Measurement], frame: RawFrame, products: Products) -> None:
        guard = _Telling("pipeline", frame, products)
        waiting = iter(found)
        done = False
        while not done:
            with guard:  # once for all of them; behind one that fails, once more for the rest
                for measurement in waiting:
                    stamped = self._times.stamp(device, self._mountings.turn(device, measurement))
                    products.measurements.append((device, stamped))
                    products.outputs += self._pipeline.feed(device, stamped)
                done = True

    def clocks_of(self, device: str, t_ns: int) -> list[dict[str, Any]]:
        """What is known of the clocks of a device at a time, as ``/fti/device_clock`` has it."""
        return self._times.clocks_of(device, t_ns)

    def _tell_times(self, t_ns: int, products: Products) -> None:
        if note := self._times.tick(t_ns):
            products.notes.append((DEVICE_CLOCK_TOPIC, t_ns, note))
            products.outputs += self._times.take_events(t_ns)

    def _decode(self, listener: Listener, frame: RawFrame, products: Products) -> list[Measurement]:
        found: list[Measurement] = []
        whole = False
        with _Telling(listener.name, frame, products):
            found = listener.decoder.feed(frame.data, frame.t_rx_ns)
            whole = True
        if not whole:  # a decoder must not fail; if one does, it alone starts again
            listener.start_afresh(FAILURE)
        if found:
            listener.messages += len(found)
            listener.last_ns = frame.t_rx_ns
        return found


def _alarm_note(report: Report) -> tuple[str, int, dict[str, Any]]:
    return ALARM_REPORT_TOPIC, report.t_ns, report.as_json()


class _Telling(Guard):
    """A failure becomes an event among the outputs, at the time of the frame: it is the same when reprocessed."""

    __slots__ = ("_frame", "_products", "_unit")

    def __init__(self, unit: str, frame: RawFrame, products: Products) -> None:
        self._unit, self._frame, self._products = unit, frame, products

    def report(self, error: Exception) -> None:
        text = f"failed at seq {self._frame.seq} and goes on: {type(error).__name__}: {error}"
        event = Event(t_ns=self._frame.t_rx_ns, level="error", source=self._unit, text=text)
        self._products.outputs.append(event)


def _go_on(counters: Counters, before: Counters, reason: str) -> None:
    """Count on from where another decoder ended; what that one neither framed nor skipped is skipped now."""
    counters.bytes_in, counters.framed = before.bytes_in, before.framed
    counters.messages.update(before.messages)
    counters.skipped.update(before.skipped)
    counters.lost.update(before.lost)
    if rest := before.bytes_in - before.framed - before.skipped.total():
        counters.skipped[reason] += rest
