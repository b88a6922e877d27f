"""TCP server and datagrams of the sinks: clients and receivers that are slow, gone, many, or flood."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing

import pytest

from fti.errors import ConfigError
from fti.publish.current_output import LatestValue, Periodic
from fti.publish.sink import SinkError
from fti.publish.tcp_server import MAX_CLIENTS, TcpServer
from fti.publish.udp_sender import UdpSender
from tests.e2e.harness import free_udp_port
from tests.helpers import until
from tests.publish.solutions import ignore
from tests.small_config import LINE as CONFIG
from tests.small_config import parsed

LINE = b"$INRMC,,V,,,,,,,,,,N*34\r\n"


@pytest.fixture
def server() -> Iterator[tuple[TcpServer, int]]:
    port = free_udp_port()
    found = TcpServer(port, "publish.nmea.tcp_port", ignore)
    found.open()
    yield found, port
    found.close()


def connect(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=10.0)


def clients_after_line(server: TcpServer) -> int:
    server.send(LINE)
    return server.count_clients()


def count_clients(server: TcpServer) -> int:
    server.send()
    return server.count_clients()


def reachable_after_line(sender: UdpSender) -> int:
    sender.send(LINE)
    return sender.count_reachable()


def test_100_clients_get_every_line(server: tuple[TcpServer, int]) -> None:
    found, port = server
    with ExitStack() as stack:
        clients = [stack.enter_context(connect(port)) for _ in range(100)]
        for _ in range(3):
            found.send(LINE)
        assert found.count_clients() == 100
        for client in clients:
            assert client.recv(1000).startswith(LINE)


def test_more_clients_than_allowed_are_disconnected(server: tuple[TcpServer, int]) -> None:
    found, port = server
    with ExitStack() as stack:
        clients = [stack.enter_context(connect(port)) for _ in range(MAX_CLIENTS)]
        found.send()
        with connect(port) as refused:
            found.send(LINE)
            assert refused.recv(100) == b""
        assert found.count_clients() == MAX_CLIENTS
        clients.pop().close()
        until(lambda: clients_after_line(found) == MAX_CLIENTS - 1)


def test_a_client_that_does_not_read_is_dropped_and_the_others_stay(server: tuple[TcpServer, int]) -> None:
    found, port = server
    with connect(port) as slow, connect(port) as reader:
        data = LINE * 100
        received = 0
        for _ in range(10_000):
            found.send(data)
            received += len(reader.recv(2 * len(data)))
            if found.count_clients() == 1:
                break
        assert found.count_clients() == 1
        slow.settimeout(10.0)
        until(lambda: not slow.recv(2**20))  # what the kernel had, then the end
        found.send(data)
        assert reader.recv(100)


def test_a_client_that_has_got_a_part_of_a_line_is_dropped(server: tuple[TcpServer, int]) -> None:
    found, port = server
    with connect(port):
        until(lambda: count_clients(found) == 1)
        found.send(bytes(50_000_000))
        assert found.count_clients() == 0


def test_a_flood_of_a_client_is_bounded_and_discarded(server: tuple[TcpServer, int]) -> None:
    found, port = server
    with connect(port) as flooder, connect(port) as reader:
        found.send()
        flooder.setblocking(False)
        sent = 0
        for _ in range(200):
            try:
                sent += flooder.send(b"$PMTK103*30\r\n" * 10_000)
            except BlockingIOError:
                found.send(LINE)
        assert sent < 10_000_000
        assert found.count_clients() == 2
        assert reader.recv(100).startswith(LINE)


def test_clients_that_leave_are_forgotten(server: tuple[TcpServer, int]) -> None:
    found, port = server
    with connect(port) as client:
        found.send(LINE)
        assert found.count_clients() == 1
        assert client.recv(100) == LINE
    until(lambda: count_clients(found) == 0)


def test_a_port_in_use_is_named(server: tuple[TcpServer, int]) -> None:
    _, port = server
    with pytest.raises(SinkError, match=rf"publish\.nmea\.tcp_port: 127\.0\.0\.1:{port}: Address already in use"):
        TcpServer(port, "publish.nmea.tcp_port", ignore).open()


# ------------------------------------------------------------------------------------------------------- datagrams


def test_a_receiver_that_is_not_there_is_no_error_and_comes_later() -> None:
    port, other = free_udp_port(), free_udp_port()
    with closing(UdpSender((f"127.0.0.1:{port}", f"127.0.0.1:{other}"), "publish.x.udp", ignore)) as sender:
        sender.open()
        until(lambda: reachable_after_line(sender) == 0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.bind(("127.0.0.1", port))
            receiver.settimeout(10.0)
            sender.send(LINE)
            assert receiver.recv(100) == LINE
            sender.send(LINE)
            assert receiver.recv(100) == LINE
            until(lambda: reachable_after_line(sender) == 1)


def test_the_first_datagram_after_a_refused_one_arrives() -> None:
    """The kernel reports the refusal instead of sending it."""
    port = free_udp_port()
    with closing(UdpSender((f"127.0.0.1:{port}",), "publish.x.udp", ignore)) as sender:
        sender.open()
        sender.send(b"refused")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.bind(("127.0.0.1", port))
            receiver.settimeout(5.0)
            sender.send(LINE)
            assert receiver.recv(100) == LINE


def test_a_receiver_may_have_an_address_of_ipv6() -> None:
    with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as receiver:
        try:
            receiver.bind(("::1", 0))
        except OSError:
            pytest.skip("the machine has no IPv6")
        receiver.settimeout(5.0)
        with closing(UdpSender((f"[::1]:{receiver.getsockname()[1]}",), "publish.x.udp", ignore)) as sender:
            sender.open()
            sender.send(LINE)
            assert receiver.recv(100) == LINE


def test_what_a_receiver_sends_back_is_never_read() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10.0)
        with closing(UdpSender((f"127.0.0.1:{receiver.getsockname()[1]}",), "publish.x.udp", ignore)) as sender:
            sender.open()
            sender.send(LINE)
            data, address = receiver.recvfrom(100)
            for _ in range(20_000):
                receiver.sendto(bytes(1000), address)
            sender.send(LINE)
            assert receiver.recv(100) == data == LINE


def test_an_address_that_cannot_be_used_is_an_error_only_without_another_receiver() -> None:
    """The kernel refuses the broadcast address of loopback."""
    with closing(UdpSender(("127.255.255.255:4000",), "publish.x.udp", ignore)) as sender:
        with pytest.raises(SinkError, match=r"publish\.x\.udp: 127\.255\.255\.255:4000: Permission denied"):
            sender.open()
        with pytest.raises(SinkError):
            sender.send(LINE)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10.0)
        both = ("127.255.255.255:4000", f"127.0.0.1:{receiver.getsockname()[1]}")
        with closing(UdpSender(both, "publish.x.udp", ignore)) as sender:
            sender.open()
            sender.send(LINE)
            assert receiver.recv(100) == LINE
            assert sender.count_reachable() == 1


@pytest.mark.parametrize(
    ("endpoint", "message"),
    [
        ("239.1.2.3:4000", "must be the address of one receiver; multicast and broadcast are not allowed"),
        ("[ff02::1]:4000", "must be the address of one receiver; multicast and broadcast are not allowed"),
        ("255.255.255.255:4000", "must be the address of one receiver; multicast and broadcast are not allowed"),
        ("0.0.0.0:4000", "must be the address of one receiver; multicast and broadcast are not allowed"),
        ("127.0.0.1:0", "port 0; allowed is 1 to 65535"),
        ("127.0.0.1:70000", "port 70000; allowed is 0 to 65535"),
        ("127.0.0.300:4000", "127.0.0.300 is not an IP address"),
        ("tablet:4000", "must be ADDRESS:PORT"),
        ("127.0.0.1", "must be ADDRESS:PORT"),
    ],
)
def test_an_endpoint_that_is_not_one_receiver_is_refused(endpoint: str, message: str) -> None:
    with pytest.raises(ConfigError, match=r"publish\.nmea\.udp") as error:
        parsed(CONFIG + f'\n[publish.nmea]\nudp = ["{endpoint}"]\n')
    assert message in str(error.value)


def test_nmea_needs_a_receiver() -> None:
    with pytest.raises(ConfigError, match=r"publish\.nmea.*tcp_port or udp is required"):
        parsed(CONFIG + "\n[publish.nmea]\n")


# --------------------------------------------------------------------------------------------------------- events


class Events:
    """Events at a time that the test sets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 1000.0
        self._events: list[tuple[str, str]] = []
        monkeypatch.setattr(time, "monotonic", lambda: self.now_s)

    def __call__(self, level: str, text: str) -> None:
        self._events.append((level, text))

    def take(self, after_s: float = 0.0) -> list[tuple[str, str]]:
        """The events since the last call; then the time goes on."""
        self.now_s += after_s
        found, self._events = self._events, []
        return found


def test_a_receiver_that_is_not_there_is_an_event_and_so_is_its_return(monkeypatch: pytest.MonkeyPatch) -> None:
    port, events = free_udp_port(), Events(monkeypatch)
    with closing(UdpSender((f"127.0.0.1:{port}",), "publish.x.udp", events)) as sender:
        sender.open()
        for _ in range(20):
            sender.send(LINE)
        where = f"publish.x.udp: 127.0.0.1:{port}"
        assert events.take() == [("warning", f"{where}: Connection refused; tried again with each datagram")]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.bind(("127.0.0.1", port))
            for _ in range(3):
                sender.send(LINE)
            assert events.take(after_s=11.0) == []
            sender.send(LINE)
            assert events.take() == [("info", f"{where}: datagrams are accepted again")]


def test_an_address_that_cannot_be_used_beside_others_is_an_event(monkeypatch: pytest.MonkeyPatch) -> None:
    events = Events(monkeypatch)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        both = ("127.255.255.255:4000", f"127.0.0.1:{receiver.getsockname()[1]}")
        with closing(UdpSender(both, "publish.x.udp", events)) as sender:
            sender.open()
            sender.send(LINE)
    text = "publish.x.udp: 127.255.255.255:4000: Permission denied; tried again with each datagram"
    assert events.take() == [("warning", text)]


def test_dropped_and_refused_clients_are_counted_in_few_events(monkeypatch: pytest.MonkeyPatch) -> None:
    port, events = free_udp_port(), Events(monkeypatch)
    with closing(TcpServer(port, "publish.nmea.tcp_port", events)) as server, ExitStack() as stack:
        server.open()
        stack.enter_context(connect(port))
        server.send(bytes(50_000_000))
        server.send(bytes(50_000_000))
        for _ in range(MAX_CLIENTS + 2):
            stack.enter_context(connect(port))
            server.send()
        text = "publish.nmea.tcp_port: a client does not read; it was disconnected"
        assert events.take(after_s=11.0) == [("warning", text)]
        server.send()
        text = f"publish.nmea.tcp_port: a client was refused: {MAX_CLIENTS} are connected (2 times)"
        assert events.take() == [("warning", text)]


# --------------------------------------------------------------------------------------------------- current values


def test_the_latest_value_is_lost_when_the_next_is_overdue() -> None:
    latest = LatestValue(rate_hz=5.0, initial="none")
    assert latest.get(0.0) == "none"
    latest.set("value", 10.0)
    assert latest.get(10.8) == "value"
    assert latest.get(10.95) == "none"


def test_what_is_periodic_keeps_its_mean_rate() -> None:
    heartbeat = Periodic(1.0)
    times_s = [step * 0.3 for step in range(1000)]
    assert sum(heartbeat.is_due(now_s) for now_s in times_s) == pytest.approx(300, abs=1)
    assert heartbeat.is_due(1e6)
    assert not heartbeat.is_due(1e6 + 0.9)
