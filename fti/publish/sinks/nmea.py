"""NMEA 0183 sentences to gpsd and moving maps: a TCP server on this computer, and datagrams.

Sentences follow each solution, at most at the configured rate.  When none comes, sentences without a position follow
once a second.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress

from fti.config.publish_tables import NmeaTable
from fti.publish.current_output import LatestValue, Periodic
from fti.publish.mean_sea_level import MeanSeaLevel
from fti.publish.message import PublishedMessage
from fti.publish.navigation_values import NAVIGATION_TOPIC, NO_NAVIGATION, NavigationValues, read_navigation
from fti.publish.nmea_sentences import encode
from fti.publish.notices import Notify
from fti.publish.sink import SinkError
from fti.publish.tcp_server import TcpServer
from fti.publish.udp_sender import UdpSender

SILENCE_PERIOD_S = 1.0


class NmeaSink:
    """See the module, and ``Sink``."""

    topics: Sequence[str] = (NAVIGATION_TOPIC,)

    def __init__(self, table: NmeaTable, notify: Notify) -> None:
        self._table = table
        self._server = TcpServer(table.tcp_port, "publish.nmea.tcp_port", notify) if table.tcp_port else None
        self._datagrams = UdpSender(table.udp, "publish.nmea.udp", notify)
        self._latest = LatestValue[NavigationValues | None](table.rate_hz, None)
        self._silence = Periodic(SILENCE_PERIOD_S)
        self._sea = MeanSeaLevel()

    def open(self) -> None:
        """See ``Sink``."""
        if self._server:
            self._server.open()
        with self._datagrams_may_fail():
            self._datagrams.open()

    def send(self, messages: Sequence[PublishedMessage]) -> None:
        """See ``Sink``."""
        now_s = time.monotonic()
        for message in messages:
            values = read_navigation(message, now_s)
            self._latest.set(values, now_s)
            self._send(values)
        if not messages:
            is_silent = self._latest.get(now_s) is None and self._silence.is_due(now_s)
            self._send(NO_NAVIGATION) if is_silent else self._serve()

    def count_peers(self) -> int | None:
        """Clients of the server, and receivers of datagrams that are reachable."""
        return (self._server.count_clients() if self._server else 0) + self._datagrams.count_reachable()

    def close(self) -> None:
        """See ``Sink``."""
        self._datagrams.close()
        if self._server:
            self._server.close()

    def _send(self, values: NavigationValues) -> None:
        data = encode(values, self._table.sentences, self._table.talker, self._sea)
        if self._server:
            self._server.send(data)
        with self._datagrams_may_fail():
            self._datagrams.send(data)

    def _serve(self) -> None:
        if self._server:
            self._server.send()

    def _datagrams_may_fail(self) -> suppress:
        """The clients of the server stay connected when no receiver of datagrams has a route."""
        return suppress(*([SinkError] if self._server else []))
