"""The publish process with NMEA, GDL 90 and MAVLink at once, whose peers are many, slow, gone, or flood it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from pymavlink import mavutil

from fti.config import Publish
from fti.config.publish_tables import Gdl90Table, MavlinkTable, NmeaTable
from tests.bus.running_hub import RunningHub, wait_for
from tests.e2e.harness import free_udp_port
from tests.helpers import until
from tests.publish.gpsd import connected
from tests.publish.running_publisher import RunningPublisher
from tests.publish.solutions import message, solution

CLIENTS = 100
FEED_S, FEED_HZ = 4.0, 25.0
#: Growth of the memory under the flood [MB]; that of the flood itself is 100 times more.
MAX_GROWTH_MB = 10.0


@contextmanager
def flooding(peers: list[Callable[[bytes], int]]) -> Iterator[list[int]]:
    """Each peer sends as much as it can; gives the bytes that the system has taken."""
    is_over, taken = threading.Event(), [0]

    def flood() -> None:
        while not is_over.is_set():
            for peer in peers:
                try:
                    taken[0] += peer(bytes(1400))
                except BlockingIOError:
                    time.sleep(0.001)

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        yield taken
    finally:
        is_over.set()
        thread.join()


def feed(hub: RunningHub) -> int:
    """Publish solutions on the bus; returns their number."""
    number = round(FEED_S * FEED_HZ)
    for _ in range(number):
        t_ns = time.time_ns()
        hub.hub.publish("/nav/nav_solution", message(solution(t_ns=t_ns, t_valid_ns=t_ns)).payload)
        time.sleep(1.0 / FEED_HZ)
    return number


def test_floods_and_absent_peers_change_nothing_for_the_others() -> None:
    nmea, mavlink, absent = (free_udp_port() for _ in range(3))
    tables = Publish(
        nmea=NmeaTable(tcp_port=nmea, udp=(f"127.0.0.1:{absent}",)),
        gdl90=Gdl90Table(udp=(f"127.0.0.1:{absent}",)),
        mavlink=MavlinkTable(udp=(f"127.0.0.1:{mavlink}",)),
    )
    with ExitStack() as stack:
        hub = stack.enter_context(RunningHub())
        station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{mavlink}")
        stack.callback(station.close)
        running = stack.enter_context(RunningPublisher(hub, tables))
        clients = [stack.enter_context(until(lambda: connected(nmea))) for _ in range(CLIENTS)]
        wait_for(lambda: "nmea" in running.sinks and running.sinks["nmea"].peers == CLIENTS, "100 clients")
        station.wait_heartbeat(timeout=10)
        before_mb = running.resident_mb()
        clients[0].setblocking(False)
        (address,) = station.clients
        with flooding([clients[0].send, lambda data: int(station.port.sendto(data, address))]) as taken:
            feed(hub)
        wait_for(lambda: running.sinks["nmea"].sent >= FEED_S * 4, "the sentences")
        assert taken[0] > 1_000_000
        for client in clients:
            client.setblocking(False)
            lines = client.recv(2**20).splitlines()
            assert sum(line.startswith(b"$INRMC") and b",A," in line for line in lines) > 4 * FEED_S
        positions = 0
        while (one := station.recv_match(type="GLOBAL_POSITION_INT")) is not None:
            positions += one.get_srcSystem() == 100
        assert positions > 8 * FEED_S
        assert running.sinks["nmea"].peers == CLIENTS
        assert running.sinks["mavlink"].peers == 1
        assert running.sinks["gdl90"].peers == 0
        assert {sink.state for sink in running.sinks.values()} == {"connected"}
        assert running.resident_mb() - before_mb < MAX_GROWTH_MB
        refused = [event.text for event in running.events if "Connection refused" in event.text]
        assert len(refused) == 2  # of NMEA and of GDL 90
