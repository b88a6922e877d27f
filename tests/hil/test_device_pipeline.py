"""Messages that were made before they were due: the same bytes, at the same instants, in the same order."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar, cast

import pytest

from fti.config import Config
from fti.drivers import honeywell_hmr2300, power_unit
from fti.hil.device_pipeline import DevicePipeline
from fti.hil.device_streams import SensorStream
from fti.hil.emulator import Emulator
from fti.hil.environment import Environment
from fti.hil.memory_backend import MemoryBackend
from fti.hil.ports.endpoints import Endpoint
from fti.hil.scheduler import MAX_LEAD_S, PreparationQueue, Scheduler
from fti.hil.sensors import SimulatedSensor
from fti.hil.tables.fault_types import BitErrors, Breaker, Burst, Cut, Duplicated, Fault, Freeze, Stuck
from fti.hil.tables.flights import ApproachFlight
from fti.hil.tables.schema import Scenario
from fti.messages.measurements import Measurement
from tests.hil.faults.device_flights import DEVICES, START_NS, Flight, device, fly, nominal
from tests.hil.test_emulator import demo_config
from tests.hil.worlds import flat_terrain, path, scenario

FAULTS: tuple[Fault, ...] = (
    Stuck(kind="stuck", from_s=0.5, to_s=1.5),
    BitErrors(kind="bit_errors", from_s=1.0, to_s=2.0, rate=0.01),
    Cut(kind="cut", from_s=2.05, to_s=2.95),
    Freeze(kind="freeze", from_s=3.5, to_s=4.0),
    Burst(kind="burst", hold_s=0.33, from_s=4.0, to_s=5.0),
    Duplicated(kind="duplicated", from_s=5.0, to_s=5.5),
)


def fly_prepared(line: DevicePipeline, depth: int = 5) -> Flight:
    """Messages are made as soon as those before them have left, so many at once."""
    flight: Flight = []
    while (t := line.due_s()) is not None:
        if line.unprepared_s == line.cycle_s:
            for _ in range(depth):
                line.prepare_cycle(START_NS)
        if messages := line.step(START_NS):
            flight.append((t, messages))
    return flight


@pytest.mark.parametrize("name", DEVICES)
def test_what_leaves_is_the_same(name: str) -> None:
    assert fly_prepared(DevicePipeline(device(name), scenario())) == nominal(name)
    assert fly_prepared(DevicePipeline(device(name), scenario(fault=FAULTS, seed=7))) == fly(name, *FAULTS)


def test_what_a_fault_cuts_off_is_not_sent_though_it_was_made() -> None:
    instants = [t for t, _ in fly_prepared(DevicePipeline(device("mavlink"), scenario(fault=FAULTS)))]
    assert not [t for t in instants if 2.05 <= t < 2.95]
    assert [t for t in instants if 1.9 < t < 2.05]


class Hand:
    """A switch, and a device that loses its settings when power returns."""

    def __init__(self, sensor: SimulatedSensor, plan: Scenario) -> None:
        self.on, self.sensor = True, sensor
        self.line = DevicePipeline(sensor, plan, is_powered=lambda t: self.on)

    def switch_on(self) -> None:
        self.on = True
        self.sensor.encoder = self.sensor.bound.driver.make_encoder(self.sensor.bound.options)


def switched(*, makes_ahead: bool, off: Sequence[int], on: Sequence[int]) -> list[list[bytes]]:
    """Thirty cycles of a device that counts its messages; it is switched before those cycles."""
    hand, found = Hand(device("mavlink"), scenario()), []
    for k in range(30):
        while makes_ahead and (hand.line.unprepared_s or 0.0) < hand.line.sensor.due[k + 4]:
            if not hand.line.prepare_cycle(START_NS):
                break
        if k in off:
            hand.on = False
        if k in on:
            hand.switch_on()
        found.append(hand.line.step(START_NS))
    return found


def test_what_was_made_before_the_power_went_is_not_sent() -> None:
    at_once = switched(makes_ahead=False, off=[10], on=[20])
    assert switched(makes_ahead=True, off=[10], on=[20]) == at_once
    assert not any(at_once[10:20])
    assert all(at_once[20:])


def test_a_device_that_got_power_again_between_two_messages_begins_anew() -> None:
    at_once = switched(makes_ahead=False, off=[10], on=[10])
    assert switched(makes_ahead=True, off=[10], on=[10]) == at_once
    assert at_once[10] != switched(makes_ahead=False, off=[], on=[])[10]


def test_what_it_had_made_for_later_is_not_kept_without_power() -> None:
    hand = Hand(device("honeywell_hmr2300"), scenario())
    assert all(hand.line.prepare_cycle(START_NS) for _ in range(3))
    hand.on = False
    assert hand.line.step(START_NS) == []
    hand.on = True
    assert hand.line.step(START_NS) == fly("honeywell_hmr2300")[1][1]


def commanded(made: int) -> tuple[list[bytes], list[list[bytes]]]:
    """A command to a magnetometer that has made so many messages; what it answers at once, and what leaves then."""
    line = DevicePipeline(device("honeywell_hmr2300"), scenario())
    assert all(line.prepare_cycle(START_NS) for _ in range(made))
    at_once = line.respond(honeywell_hmr2300.command("average", {"state": "on"}), 0.0)
    return at_once, [line.step(START_NS) for _ in range(5)]


def test_an_answer_waits_for_the_messages_that_were_made_before_it() -> None:
    answers, unasked = commanded(0)
    assert answers
    assert all(unasked)
    before = [messages for _, messages in fly("honeywell_hmr2300")[:5]]
    for made in (1, 3):
        held_back, leaves = commanded(made)
        assert held_back == []
        assert leaves[:made] == [*before[: made - 1], [*before[made - 1], *answers]]
        assert leaves[made:] == unasked[made:]


def test_a_device_that_receives_bytes_in_flight_prepares_nothing_any_more() -> None:
    line = DevicePipeline(device("honeywell_hmr2300"), scenario())
    question = honeywell_hmr2300.command("average", {"state": "on"})
    assert line.respond(question, 0.0) == (answers := line.respond(question, -1.0))
    line.prepare_cycle(START_NS)
    assert line.respond(question, 0.0) == answers  # at once


def test_the_power_unit_says_what_is_when_it_says_it() -> None:
    sensor = device("power_unit")
    sensor.is_live = True
    line = DevicePipeline(sensor, scenario())
    line.prepare_cycle(START_NS)
    assert line.respond(power_unit.command("off", {"breaker": "altimeter"}), 0.0)  # nothing that it could wait for


class Sink:
    """An end that takes everything."""

    is_stream = False

    def send(self, data: bytes) -> None: ...


class Slow:
    """A second passes with each message that a device makes."""

    def __init__(self, patch: pytest.MonkeyPatch, name: str) -> None:
        self.now, self.sensor = 0.0, device(name)
        self._measure = self.sensor.measure
        patch.setattr(self.sensor, "measure", self._slowly)
        patch.setattr(time, "monotonic", lambda: self.now)
        patch.setattr(time, "thread_time", lambda: self.now)

    def _slowly(self, k: int, start_ns: int) -> list[Measurement]:
        self.now += 1.0
        return self._measure(k, start_ns)


def test_what_took_long_is_made_in_a_long_gap_alone_until_that_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = Slow(monkeypatch, "mavlink")
    stream = SensorStream(DevicePipeline(slow.sensor, scenario()), cast("Endpoint", Sink()), START_NS)
    first_s = stream.due_s() or 0.0
    assert stream.prepare(0.5, first_s)
    assert not stream.prepare(0.5, math.inf)
    assert not stream.prepare(1.5, first_s)  # that is made
    assert stream.prepare(3.5, math.inf)
    assert slow.now == pytest.approx(4.0)  # three more: the fourth would have ended 0.5 s late
    for _ in range(50):  # 0.98^50 = 0.36
        asyncio.run(stream.send())
    assert stream.prepare(0.5, math.inf)


Sent = list[tuple[int, str, bytes]]


class Timed(MemoryBackend):
    """Its clock jumps, and yet everything is made ahead."""

    is_real_time: ClassVar[bool] = True


def sent_by_all(bench_type: type[MemoryBackend], config: Config) -> Sent:
    """When, on which link, what: a second of all devices of the demonstration; two have no power for a while."""
    trip = Breaker(kind="breaker", devices=("gnss", "autopilot"), from_s=0.3, to_s=0.5)
    flight = scenario(flight=ApproachFlight(duration_s=1.0), fault=(trip, *FAULTS))
    found: Sent = []
    bench = bench_type(lambda link, data: found.append((bench.clock.now_ns(), link, data)), ())
    emulator = Emulator(config, flight, bench, world=Environment(flight, path(), flat_terrain(), undulation=47.0))
    emulator.start()
    asyncio.run(emulator.run())
    return found


def test_all_devices_send_the_same_at_the_same_instants(tmp_path: Path) -> None:
    config = demo_config(tmp_path)
    at_once = sent_by_all(MemoryBackend, config)
    assert {link for _, link, _ in at_once} == {link.name for link in config.link}
    assert sent_by_all(Timed, config) == at_once


# -------------------------------------------------------------------------------------------------------- scheduler


class Made:
    """A stream of a message each 10 ms whose making takes ``cost`` seconds, at its instant or before.

    now   : the time, as a list of one [s]
    early : so long before its instant each was made ahead [s]
    """

    def __init__(self, now: list[float], cost: float, shift: float, period: float = 0.01, count: int = 20) -> None:
        self.now, self.cost, self.shift, self.period, self.count = now, cost, shift, period, count
        self.k = self.made = 0
        self.late: list[float] = []
        self.early: list[float] = []

    def _due_s(self, k: int) -> float | None:
        return self.shift + self.period * k if k < self.count else None

    def due_s(self) -> float | None:
        return self._due_s(self.k)

    def unprepared_s(self) -> float | None:
        return self._due_s(self.made)

    def note(self, due_s: float, late_s: float) -> None:
        self.late.append(late_s)

    def prepare(self, within_s: float, until_s: float) -> bool:
        begin, before = self.now[0], self.made
        while self.now[0] + self.cost <= begin + within_s and (self.unprepared_s() or math.inf) <= until_s:
            self.early.append((self.unprepared_s() or 0.0) - self.now[0])
            self.now[0] += self.cost
            self.made += 1
        return self.made > before

    def complete(self) -> None:
        if self.made == self.k:
            self.now[0] += self.cost
            self.made += 1

    async def send(self) -> None:
        self.complete()
        self.k += 1


def run_streams(now: list[float], *streams: Made, can_prepare: bool = True) -> None:
    """All of them by the scheduler; sleeping moves the time."""

    async def sleep(seconds: float) -> None:
        now[0] += seconds

    asyncio.run(Scheduler(lambda: now[0], sleep, can_prepare=can_prepare).run(streams, asyncio.Event()))
    assert [len(stream.late) for stream in streams] == [stream.count for stream in streams]
    assert all(late >= 0.0 for stream in streams for late in stream.late)


def latest(*, can_prepare: bool) -> tuple[float, float]:
    """Two streams, of which the first takes 4 ms and the other is due 1 ms behind it; how late each was at most [s]."""
    now = [0.0]
    streams = Made(now, 0.004, 0.009), Made(now, 0.0001, 0.010)
    run_streams(now, *streams, can_prepare=can_prepare)
    first, second = (max(stream.late) for stream in streams)
    return first, second


def test_what_is_made_in_a_gap_makes_nobody_wait() -> None:
    first, second = latest(can_prepare=False)
    assert second == pytest.approx(0.003)
    first, second = latest(can_prepare=True)
    assert math.isclose(first, 0.0, abs_tol=1e-9)
    assert second < 1e-9


def test_a_fast_stream_is_on_time_where_no_gap_holds_a_message_of_it() -> None:
    """For 40 ms another one is due each 40 us; a message of the fast one takes 50 us."""
    now = [0.0]
    fast = Made(now, 50e-6, 0.2, period=1.0 / 1200.0, count=400)
    other = Made(now, 1e-6, 0.3, period=40e-6, count=1000)
    run_streams(now, fast, other)
    assert max(fast.late) < 1e-9
    assert max(other.late) < 1e-9
    assert max(fast.early) > 0.75 * MAX_LEAD_S  # once it makes, it goes on


def test_what_had_no_gap_is_made_at_its_instant_and_the_next_one_once() -> None:
    """It takes 4 ms, and the first one is due after 1 ms."""
    now = [0.0]
    stream = Made(now, 0.004, 0.001)
    run_streams(now, stream)
    assert stream.late == pytest.approx([0.004, *[0.0] * 19], abs=1e-9)  # its own making, too, makes it late


def test_nothing_is_made_long_before_its_instant() -> None:
    """An answer waits for what its device has made: of a slow one it came a period late."""
    now = [0.0]
    slow, fast = Made(now, 0.001, 0.5, period=5.0), Made(now, 0.001, 0.5, period=0.01)
    run_streams(now, slow, fast)
    assert len(slow.early) == len(fast.early) == 20
    assert max(slow.early) <= MAX_LEAD_S
    assert max(slow.late) < 1e-9


def test_what_a_device_makes_at_its_instant_makes_it_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """It has received bytes, so that nothing is prepared any more; encoding takes 4 ms."""
    now, sensor = [0.0], device("honeywell_hmr2300")
    measure = sensor.measure

    def slowly(k: int, start_ns: int) -> list[Measurement]:
        now[0] += 0.004
        return measure(k, start_ns)

    async def sleep(seconds: float) -> None:
        now[0] += seconds

    monkeypatch.setattr(sensor, "measure", slowly)
    line = DevicePipeline(sensor, scenario())
    line.respond(honeywell_hmr2300.command("average", {"state": "on"}), 0.0)
    stream = SensorStream(line, cast("Endpoint", Sink()), START_NS)
    asyncio.run(Scheduler(lambda: now[0], sleep, can_prepare=True).run([stream], asyncio.Event()))
    late = stream.meter.rate.lateness
    assert late.messages > 50
    assert late.p50_ms == pytest.approx(4.0, rel=0.07)


def test_the_soonest_that_fits_is_made_first_and_each_once() -> None:
    """None of two messages is made twice; what is not due within REFILL_S is left for later."""
    now = [0.0]
    streams = [
        Made(now, cost, shift, period=1.0, count=1) for cost, shift in ((4e-3, 0.01), (1e-3, 0.02), (1e-3, 0.09))
    ]
    queue = PreparationQueue(streams)
    assert queue.prepare_next(0.0, 0.002)
    assert [stream.made for stream in streams] == [0, 1, 0]
    queue.complete(0)
    queue.update(0)
    assert [stream.made for stream in streams] == [1, 1, 0]
    assert not queue.prepare_next(0.02, 1.0)
    assert queue.prepare_next(0.04, 1.0)
    assert not queue.prepare_next(0.04, 1.0)
    assert [stream.made for stream in streams] == [1, 1, 1]
