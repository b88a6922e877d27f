"""GDL 90 messages to tablets, one in each datagram.

once a second : heartbeat, ownship report, geometric altitude if it is valid, ForeFlight ID; without a solution they say
                that there is no position
each solution : ForeFlight AHRS, at most at the configured rate; without a solution once a second, invalid
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from fti.config.publish_tables import Gdl90Table
from fti.publish import gdl90_messages as gdl90
from fti.publish.current_output import LatestValue, Periodic
from fti.publish.message import PublishedMessage, SessionIdentity
from fti.publish.navigation_values import NAVIGATION_TOPIC, NO_NAVIGATION, NavigationValues, read_navigation
from fti.publish.notices import Notify
from fti.publish.udp_sender import UdpSender

HEARTBEAT_PERIOD_S = 1.0


class Gdl90Sink:
    """See the module, and ``Sink``."""

    topics: Sequence[str] = (NAVIGATION_TOPIC,)

    def __init__(self, table: Gdl90Table, identity: SessionIdentity, notify: Notify) -> None:
        self._name, self._callsign = identity.aircraft, gdl90.callsign_of(identity.aircraft)
        self._datagrams = UdpSender(table.udp, "publish.gdl90.udp", notify)
        self._latest = LatestValue(table.rate_hz, NO_NAVIGATION)
        self._heartbeat = Periodic(HEARTBEAT_PERIOD_S)

    def open(self) -> None:
        """See ``Sink``."""
        self._datagrams.open()

    def send(self, messages: Sequence[PublishedMessage]) -> None:
        """See ``Sink``."""
        now_s = time.monotonic()
        for message in messages:
            values = read_navigation(message, now_s)
            self._latest.set(values, now_s)
            self._datagrams.send(gdl90.frame(gdl90.foreflight_ahrs(values)))
        if self._heartbeat.is_due(now_s):
            for content in self._each_second(self._latest.get(now_s)):
                self._datagrams.send(gdl90.frame(content))

    def count_peers(self) -> int | None:
        """Receivers that are reachable."""
        return self._datagrams.count_reachable()

    def close(self) -> None:
        """See ``Sink``."""
        self._datagrams.close()

    def _each_second(self, values: NavigationValues) -> Iterator[bytes]:
        """Heartbeat first: its time applies to what follows (ICD 3.1)."""
        yield gdl90.heartbeat(values)
        yield gdl90.ownship_report(values, self._callsign)
        if altitude := gdl90.geometric_altitude(values):
            yield altitude
        yield gdl90.foreflight_id(self._name)
        if values is NO_NAVIGATION:
            yield gdl90.foreflight_ahrs(values)
