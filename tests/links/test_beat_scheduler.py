"""The common poll of all sockets: with each beat, and again soon after full batches."""

from __future__ import annotations

import asyncio
import functools
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial

import pytest

from fti.links import _beat_scheduler
from tests.helpers import until_async


class Port:
    """A socket that is watched, and what it has heard; ``more`` is what its read says."""

    def __init__(self) -> None:
        self.near, self.far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.near.setblocking(False)
        self.received: list[bytes] = []
        self.more = False
        self.then: Callable[[], None] = lambda: None

    def read(self) -> bool:
        try:
            self.received.append(self.near.recv(100))
        except BlockingIOError:
            return False
        self.then()
        return self.more

    def watch(self) -> None:
        _beat_scheduler.watch(self.near.fileno(), self.read)

    def unwatch(self) -> None:
        _beat_scheduler.unwatch(self.near.fileno())

    def close(self) -> None:
        self.near.close()
        self.far.close()


def nothing() -> None:
    """Nobody wants a look before the beat."""


class Turns:
    """Counts the turns of the loop."""

    def __init__(self) -> None:
        self.count = 0
        self._turn()

    def _turn(self) -> None:
        self.count += 1
        self._next = asyncio.get_running_loop().call_soon(self._turn)

    def stop(self) -> None:
        self._next.cancel()


@pytest.fixture
def ports() -> Iterator[list[Port]]:
    with ExitStack() as stack:
        results = [Port() for _ in range(3)]
        for port in results:
            stack.callback(port.close)
        yield results


async def test_all_are_read_with_one_look(ports: list[Port]) -> None:
    """In the same turn of the loop, not when they have something."""
    looks: list[int] = []
    turns = Turns()
    for port in ports:
        port.then = lambda: looks.append(turns.count)
        port.watch()
    await asyncio.sleep(0)  # the first look, which finds nothing
    for turn in range(3):
        looks.clear()
        for port in ports:
            port.far.send(bytes([turn]))
        assert not looks
        await until_async(lambda turn=turn: all(len(port.received) == turn + 1 for port in ports))  # type: ignore[misc]
        assert len(looks) == len(ports)
        assert len(set(looks)) == 1
    turns.stop()
    for port in ports:
        port.unwatch()
    assert not _beat_scheduler._schedulers


async def test_the_beat_calls_behind_the_look(ports: list[Port]) -> None:
    """So that what has come until then is numbered before the tick."""
    port, reported = ports[0], list[list[bytes]]()
    port.watch()

    def beat() -> None:
        reported.append(list(port.received))

    _beat_scheduler.add_beat_callbacks(beat, nothing)
    await until_async(lambda: len(reported) > 2)
    before = len(reported)
    port.far.send(b"x")
    await until_async(lambda: len(reported) > before)
    assert reported[before] == [b"x"]
    port.unwatch()
    _beat_scheduler.remove_beat_callbacks(beat, nothing)
    assert not _beat_scheduler._schedulers


class Hands(asyncio.SelectorEventLoop):
    """A loop whose clock goes on when it is read, or moved."""

    now_s, step_s = 0.0, 0.0002

    def time(self) -> float:
        self.now_s += self.step_s
        return self.now_s


class Driven:
    """The look at the sockets in a time that stands where the test puts it.

    calls    : each beat, and each look before one, with how much each watched port had heard
    is_early : what an urgent port says of the next look
    """

    is_early = True

    def __init__(self) -> None:
        self.loop = Hands()
        self.loop.step_s = 1e-7  # a beat is over when its time is read again
        self.poll = _beat_scheduler.BeatScheduler(self.loop)
        self.calls: list[tuple[str, tuple[int, ...]]] = []
        self._ports: list[Port] = []
        self.poll.calls.append(partial(self._note, "beat"))
        self.poll.early_calls.append(partial(self._note, "early"))

    def _note(self, kind: str) -> None:
        self.calls.append((kind, tuple(len(port.received) for port in self._ports)))

    @property
    def kinds(self) -> list[str]:
        return [kind for kind, _ in self.calls]

    def watch(self, port: Port, *, urgent: bool = False) -> None:
        self._ports.append(port)
        self.poll.add(port.near.fileno(), port.read, is_early=(lambda: self.is_early) if urgent else None)

    def wait(self, seconds: float = 0.0) -> None:
        """So much later everything that is ready is called."""
        self.loop.now_s += seconds
        for _ in range(20):
            self.loop.run_until_complete(asyncio.sleep(0))

    def wait_for_beat(self, before_s: float = 0.0) -> None:
        self.wait(self.poll._beat_s - before_s - self.loop.now_s)

    def close(self) -> None:
        self.poll.close()
        self.loop.close()


@pytest.fixture
def driven() -> Iterator[Driven]:
    made = Driven()
    yield made
    made.close()


def test_an_urgent_socket_has_all_read_before_the_beat(ports: list[Port], driven: Driven) -> None:
    """What the other socket has had for longer goes on with it."""
    altimeter, attitude = ports[:2]
    driven.watch(altimeter, urgent=True)
    driven.watch(attitude)
    for turn in range(1, 4):
        driven.wait_for_beat()
        driven.calls.clear()
        attitude.far.send(b"a")
        altimeter.far.send(b"h")
        driven.wait()
        assert driven.calls == [("early", (turn, turn))]


def test_a_link_without_a_socket_has_all_read_too_a_moment_later(ports: list[Port], driven: Driven) -> None:
    """The rest of its frame may still come; what has come on a socket before goes on with it."""
    driven.watch(ports[0])
    driven.wait_for_beat()
    driven.calls.clear()
    ports[0].far.send(b"a")
    for _ in range(3):  # it asks as often as it receives
        driven.poll.schedule_early_poll("altimeter")
        driven.wait(0.25 * _beat_scheduler.EARLY_POLL_DELAY_S)
    assert driven.calls == []
    driven.wait(0.25 * _beat_scheduler.EARLY_POLL_DELAY_S)
    assert driven.calls == [("early", (1,))]


def test_a_busy_urgent_link_waits_for_the_beat_behind_its_first_look(ports: list[Port], driven: Driven) -> None:
    """Each wakes the loop once between two beats, however often it receives, and a socket does not spin."""
    bus = ports[0]
    driven.watch(bus, urgent=True)
    for _ in range(3):
        bus.more = True  # before a beat all is read, one by one
        driven.wait_for_beat()
        assert driven.kinds == ["beat"]
        bus.more = False
        for _ in range(3):
            bus.far.send(b"x")
            driven.wait()
        assert driven.kinds == ["beat", "early"]
        for _ in range(2):
            driven.poll.schedule_early_poll("line")
            driven.wait(_beat_scheduler.EARLY_POLL_DELAY_S)
        assert driven.kinds == ["beat", "early", "early"]
        driven.calls.clear()


def test_a_link_that_brings_too_much_waits_for_each_beat(ports: list[Port], driven: Driven) -> None:
    """It is asked with each beat whether the next look may be early."""
    bus = ports[0]
    driven.watch(bus, urgent=True)
    driven.wait_for_beat()
    found = list[list[str]]()
    for is_early in (False, False, True, True):
        driven.is_early = is_early
        driven.calls.clear()
        bus.far.send(b"x")
        driven.wait()
        driven.wait_for_beat()
        found.append(driven.kinds)
    assert found == [["early", "beat"], ["beat"], ["beat"], ["early", "beat"]]


def test_what_one_call_does_not_take_is_handed_on_with_the_beat(ports: list[Port], driven: Driven) -> None:
    """It may be older than the altimeter's frames: the order of arrival holds."""
    altimeter, camera = ports[:2]
    driven.watch(altimeter, urgent=True)
    driven.watch(camera)
    driven.wait_for_beat()
    driven.calls.clear()
    camera.more = True
    for _ in range(3):
        camera.far.send(b"c")
    altimeter.far.send(b"h")
    driven.wait()
    assert driven.calls == []
    driven.wait_for_beat()
    assert driven.calls == [("beat", (1, 3))]


@pytest.mark.parametrize(("before_s", "is_early"), [(0.0105, True), (0.0075, False)])
def test_what_comes_shortly_before_the_beat_waits_for_it(
    ports: list[Port], driven: Driven, before_s: float, is_early: bool
) -> None:
    """A socket, which does not spin then, and a line, whose frame has come 2 ms later."""
    driven.watch(ports[0], urgent=True)
    for arrive in (lambda: ports[0].far.send(b"x"), lambda: driven.poll.schedule_early_poll("line")):
        driven.wait_for_beat()
        driven.calls.clear()
        driven.wait_for_beat(before_s)
        arrive()
        driven.wait()
        driven.wait(_beat_scheduler.EARLY_POLL_DELAY_S)
        assert driven.kinds == ["early"] * is_early
        driven.wait_for_beat()
        assert driven.kinds == ["early"] * is_early + ["beat"]


async def test_one_that_fails_is_nobody_elses_trouble(ports: list[Port]) -> None:
    """Not even when it fails with every look, and whatever it raises: the others are read, the beat goes on."""
    sick, well = ports[:2]
    errors: list[str] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: errors.append(str(context["exception"])))

    def fail() -> bool:
        raise RuntimeError("sick")

    beats: list[int] = []
    _beat_scheduler.watch(sick.near.fileno(), fail)
    well.watch()
    beat = functools.partial(beats.append, 1)
    _beat_scheduler.add_beat_callbacks(beat, nothing)
    for turn in range(3):
        sick.far.send(b"x")
        well.far.send(b"y")
        before = len(beats)
        await until_async(lambda turn=turn: len(well.received) == turn + 1)  # type: ignore[misc]
        await until_async(lambda before=before: len(beats) > before)  # type: ignore[misc]
    assert set(errors) == {"sick"}
    for port in (sick, well):
        port.unwatch()
    _beat_scheduler.remove_beat_callbacks(beat, nothing)


def test_the_beat_waits_for_who_has_more(ports: list[Port]) -> None:
    """What came before it is numbered before the tick, however many calls reading it takes."""
    loop, port, reported = Hands(), ports[0], list[int]()
    loop.step_s = 1e-5  # ten looks take less than the beat waits
    poll = _beat_scheduler.BeatScheduler(loop)
    poll.add(port.near.fileno(), port.read)
    poll.calls.append(lambda: reported.append(len(port.received)))
    port.more = True
    for turn in range(1, 6):
        for _ in range(10):  # one look takes one
            port.far.send(b"x")
        loop.now_s = poll._beat_s
        while len(reported) < turn:
            loop.run_until_complete(asyncio.sleep(0))
        assert reported[-1] == 10 * turn
    poll.close()
    loop.close()


def test_no_beat_is_left_out_in_a_flood() -> None:
    """One reading of the clock decides on a beat and plans the next, however long a look takes."""
    loop = Hands()
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    poll, beats = _beat_scheduler.BeatScheduler(loop), list[float]()
    far.send(b"x")  # and nobody takes it: there is always more

    def read() -> bool:
        loop.now_s += 0.0007
        return True

    poll.add(near.fileno(), read)
    poll.calls.append(lambda: beats.append(loop.now_s))
    for _ in range(2000):
        loop.run_until_complete(asyncio.sleep(0))
    poll.close()
    loop.close()
    near.close()
    far.close()
    numbers = [round(t // _beat_scheduler.BEAT_S) for t in beats]
    assert len(beats) > 50
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


async def test_who_has_more_is_read_again_at_once(ports: list[Port]) -> None:
    port = ports[0]
    port.more = True
    port.watch()
    for i in range(50):
        port.far.send(bytes([i]))
        if i == 5:
            await until_async(lambda: port.received)
    await until_async(lambda: len(port.received) == 50)
    port.unwatch()


async def test_a_socket_may_be_left_while_it_is_read(ports: list[Port]) -> None:
    """As when reading finds the device gone: neither its neighbour nor a later socket suffers."""
    first, second, third = ports
    for port in (first, second):
        port.watch()
    first.then = second.unwatch
    for port in (first, second):
        port.far.send(b"x")
    await until_async(lambda: first.received)
    first.then = first.unwatch  # the last one
    first.far.send(b"y")
    await until_async(lambda: len(first.received) == 2)
    assert not _beat_scheduler._schedulers
    third.watch()
    third.far.send(b"z")
    await until_async(lambda: third.received)
    third.unwatch()


async def test_to_forget_what_was_never_watched_is_harmless(ports: list[Port]) -> None:
    ports[0].unwatch()
    ports[0].watch()
    ports[1].unwatch()
    ports[0].far.send(b"x")
    await until_async(lambda: ports[0].received)
    ports[0].unwatch()
