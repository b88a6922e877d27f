"""MAVLink 2 to QGroundControl and others, one message in each datagram.

solution        : ATTITUDE, GLOBAL_POSITION_INT and ALTITUDE, as far as it is valid
height          : DISTANCE_SENSOR, if it is valid
once a second   : HEARTBEAT, SYS_STATUS with the validity of position, attitude, height and integrity
on a change     : STATUSTEXT with the validity of the position, and the state of the clearance integrity
events          : STATUSTEXT of warnings and errors
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from pymavlink.dialects.v20 import common

from fti.bus.message import MessageError, decode
from fti.config.publish_tables import MavlinkTable
from fti.messages.outputs import IntegrityState
from fti.messages.topics import BUS_EVENT
from fti.publish import mavlink_messages as mavlink
from fti.publish.current_output import LatestValue, Periodic, current_fields, number
from fti.publish.mean_sea_level import MeanSeaLevel
from fti.publish.message import PublishedMessage
from fti.publish.navigation_values import NAVIGATION_TOPIC, NO_NAVIGATION, NavigationValues, read_navigation
from fti.publish.notices import Notify
from fti.publish.udp_sender import UdpSender

HEIGHT_TOPIC, INTEGRITY_TOPIC = "/nav/height_below_aircraft", "/nav/clearance_integrity"
HEARTBEAT_PERIOD_S = 1.0
#: Heights and integrity are repeated at 2 Hz.
REPEAT_HZ = 2.0
MAX_HEIGHT_M = 100_000.0
HEALTHY_STATES = (IntegrityState.OK, IntegrityState.MONITOR)
NO_INTEGRITY = (IntegrityState.UNAVAILABLE.value, ("no output",))


class MavlinkSink:
    """See the module, and ``Sink``."""

    topics: Sequence[str] = (NAVIGATION_TOPIC, HEIGHT_TOPIC, INTEGRITY_TOPIC, BUS_EVENT)

    def __init__(self, table: MavlinkTable, notify: Notify) -> None:
        self._datagrams = UdpSender(table.udp, "publish.mavlink.udp", notify)
        self._packer = common.MAVLink(None, srcSystem=table.system, srcComponent=table.component)
        self._sea = MeanSeaLevel()
        self._heartbeat = Periodic(HEARTBEAT_PERIOD_S)
        self._navigation = LatestValue(table.rate_hz, NO_NAVIGATION)
        self._height_agl = LatestValue[float | None](min(table.rate_hz, REPEAT_HZ), None)
        self._integrity = LatestValue(min(table.rate_hz, REPEAT_HZ), NO_INTEGRITY)
        self._present = mavlink.POSITION_BIT | mavlink.ATTITUDE_BIT
        self._start_ns: int | None = None
        self._reported: dict[str, object] = {}
        self._texts = 0

    def open(self) -> None:
        """See ``Sink``.  Texts of states that were lost are sent again."""
        self._reported.clear()
        self._datagrams.open()

    def send(self, messages: Sequence[PublishedMessage]) -> None:
        """See ``Sink``."""
        now_s = time.monotonic()
        for message in messages:
            if message.topic == BUS_EVENT:
                self._send_event(message)
            elif message.topic == NAVIGATION_TOPIC:
                self._send_navigation(read_navigation(message, now_s), now_s)
            elif message.topic == HEIGHT_TOPIC:
                self._send_height(current_fields(message, now_s), now_s)
            else:
                self._update_integrity(current_fields(message, now_s), now_s)
        if self._heartbeat.is_due(now_s):
            self._pack(mavlink.heartbeat())
            self._pack(mavlink.sys_status(self._present, self._healthy(now_s)))
        self._report_changes(now_s)

    def count_peers(self) -> int | None:
        """Receivers that are reachable."""
        return self._datagrams.count_reachable()

    def close(self) -> None:
        """See ``Sink``."""
        self._datagrams.close()

    def _pack(self, message: Any | None) -> None:
        """Send a message, if there is one."""
        if message is not None:
            self._datagrams.send(bytes(message.pack(self._packer)))
            self._packer.seq = (self._packer.seq + 1) & 0xFF

    def _send_navigation(self, values: NavigationValues, now_s: float) -> None:
        self._navigation.set(values, now_s)
        boot_ms = self._boot_ms(values.t_ns)
        undulation = 0.0
        if values.lat is not None and values.lon is not None:
            undulation = self._sea.undulation(values.lat, values.lon)
        self._pack(mavlink.attitude(values, boot_ms))
        self._pack(mavlink.global_position(values, undulation, boot_ms))
        self._pack(mavlink.altitude(values, undulation, self._height_agl.get(now_s)))

    def _send_height(self, fields: Mapping[str, Any] | None, now_s: float) -> None:
        self._present |= mavlink.ALTIMETER_BIT
        is_valid = fields is not None and fields["valid"] is True
        height_agl = number(fields, "height_agl", -MAX_HEIGHT_M, MAX_HEIGHT_M) if fields and is_valid else None
        self._height_agl.set(height_agl, now_s)
        if fields and height_agl is not None:
            sd = number(fields, "sd", 0.0, MAX_HEIGHT_M)
            self._pack(mavlink.distance_sensor(height_agl, sd, self._boot_ms(fields["t_ns"])))

    def _update_integrity(self, fields: Mapping[str, Any] | None, now_s: float) -> None:
        self._present |= mavlink.INTEGRITY_BIT
        if fields is None or fields["state"] not in tuple(IntegrityState):
            self._integrity.set(NO_INTEGRITY, now_s)
            return
        is_contradictory = fields["state"] in HEALTHY_STATES and fields["valid"] is not True
        state = IntegrityState.UNAVAILABLE.value if is_contradictory else fields["state"]
        self._integrity.set((state, tuple(fields["reasons"])), now_s)

    def _send_event(self, message: PublishedMessage) -> None:
        try:
            event = decode(message.topic, message.payload)
        except MessageError:
            return
        if severity := mavlink.SEVERITIES.get(event["level"]):
            self._send_text(severity, f"{event['source']}: {event['text']}")

    def _report_changes(self, now_s: float) -> None:
        values, (state, reasons) = self._navigation.get(now_s), self._integrity.get(now_s)
        self._report("position", values.lat is not None, mavlink.describe_position(values))
        if self._present & mavlink.INTEGRITY_BIT:
            self._report("integrity", state, mavlink.describe_integrity(state, reasons))

    def _report(self, what: str, state: object, text: tuple[int, str]) -> None:
        """Send a text when the state differs from the last one."""
        if self._reported.get(what) != state:
            self._send_text(*text)
            self._reported[what] = state

    def _send_text(self, severity: int, text: str) -> None:
        self._texts = self._texts % 0xFFFF + 1
        for chunk in mavlink.status_text(severity, text, self._texts):
            self._pack(chunk)

    def _healthy(self, now_s: float) -> int:
        values = self._navigation.get(now_s)
        states = (
            (mavlink.POSITION_BIT, values.lat is not None),
            (mavlink.ATTITUDE_BIT, values.roll is not None),
            (mavlink.ALTIMETER_BIT, self._height_agl.get(now_s) is not None),
            (mavlink.INTEGRITY_BIT, self._integrity.get(now_s)[0] in HEALTHY_STATES),
        )
        return sum(bit for bit, is_valid in states if is_valid)

    def _boot_ms(self, t_ns: int | None) -> int:
        if self._start_ns is None and t_ns is not None:
            self._start_ns = t_ns
        return mavlink.boot_ms(t_ns, self._start_ns or 0)
