"""The tables of ``[publish]``: sinks that send outputs to other programs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from fti.config.endpoints import ReceiverEndpoint
from fti.config.keys import NO_UNIT, key
from fti.config.strict_model import StrictModel

LOOPBACK_HOSTS = ("127.0.0.1", "localhost", "::1")
#: Without wildcards and separators of MQTT, zenoh and paths.
AIRCRAFT_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,31}$"
#: Endpoint of a router, in zenoh notation.
ROUTER_PATTERN = r"^(tcp|tls)/[^/\s#?]+:\d{1,5}$"

#: Keys that name a file.
FILE_KEYS = frozenset({"ca_file", "certificate", "private_key", "password_file"})

MAX_PORT = 65535
Port = Annotated[int, Field(ge=1, le=MAX_PORT)]
#: Patterns of topics.
TopicPatterns = Annotated[tuple[Annotated[str, Field(min_length=1, max_length=200)], ...], Field(min_length=1)]
RateHz = Annotated[float, Field(ge=0.001, le=1000)]
#: Rate of a protocol whose receivers take a value as current until the next one.
LiveRateHz = Annotated[float, Field(ge=1, le=50)]
#: Receivers of datagrams.
Receivers = Annotated[tuple[ReceiverEndpoint, ...], Field(max_length=16)]
SentenceName = Literal["GGA", "RMC", "VTG", "GST", "HDT"]


class TlsKeys(StrictModel):
    """Keys of a connection that TLS can protect.  Relative paths begin at the file."""

    ca_file: Annotated[
        str | None,
        key("PEM file of the authorities that may certify the peer; none: those of the system", NO_UNIT, "ca.pem"),
    ] = None
    certificate: Annotated[
        str | None, key("PEM file of our certificate; none: no certificate", NO_UNIT, "aircraft.pem")
    ] = None
    private_key: Annotated[str | None, key("PEM file of its private key", NO_UNIT, "aircraft.key")] = None

    @model_validator(mode="after")
    def _check_pair(self) -> TlsKeys:
        if (self.certificate is None) != (self.private_key is None):
            raise ValueError("certificate and private_key must both be given, or neither")
        return self


class MqttTable(TlsKeys):
    """``[publish.mqtt]``: JSON to an MQTT broker, topics ``fti/<aircraft>/<session>/...``.

    The newest value of each topic is retained by the broker.
    """

    host: Annotated[str, Field(min_length=1), key("name or address of the broker", NO_UNIT)] = "127.0.0.1"
    port: Annotated[Port | None, key("port of the broker; none: 8883 with tls, otherwise 1883", NO_UNIT, 8883)] = None
    tls: Annotated[bool, key("encrypt the connection and check the certificate of the broker", NO_UNIT, True)] = False
    user: Annotated[str | None, key("user name; none: no login", NO_UNIT, "aircraft")] = None
    password_file: Annotated[
        str | None,
        key("text file with the password in its first line, readable by its owner only", NO_UNIT, "mqtt.password"),
    ] = None
    topics: Annotated[TopicPatterns, key("patterns of the topics to send; * stands for any characters", NO_UNIT)] = (
        "*",
    )
    max_rate_hz: Annotated[RateHz, key("largest rate of each topic; events are always sent", "Hz")] = 5.0

    @model_validator(mode="after")
    def _check_login(self) -> MqttTable:
        if self.password_file and not self.user:
            raise ValueError("password_file needs user")
        if self.password_file and not self.tls and self.host not in LOOPBACK_HOSTS:
            raise ValueError("password_file needs tls = true: the password would be readable on the network")
        if not self.tls and (self.ca_file or self.certificate):
            raise ValueError("ca_file and certificate need tls = true")
        return self

    @property
    def broker_port(self) -> int:
        """Port of the broker, with its default."""
        return self.port or (8883 if self.tls else 1883)


class NmeaTable(StrictModel):
    """``[publish.nmea]``: NMEA 0183 sentences for gpsd and moving maps, over TCP on this computer and over UDP."""

    tcp_port: Annotated[Port | None, key("port of the TCP server at 127.0.0.1; none: no server", NO_UNIT, 10110)] = None
    udp: Annotated[
        Receivers, key("address and port of each receiver of datagrams", NO_UNIT, ("192.168.10.20:10110",))
    ] = ()
    talker: Annotated[
        Literal["IN", "GN", "GP"],
        key(
            "first letters of a sentence: IN integrated navigation; GN, GP for receivers that accept no other", NO_UNIT
        ),
    ] = "IN"
    sentences: Annotated[
        tuple[SentenceName, ...],
        Field(min_length=1),
        key("sentences to send; HDT is the true heading, which gpsd 3.22 cannot pass on", NO_UNIT),
    ] = ("GGA", "RMC", "VTG", "GST")
    rate_hz: Annotated[LiveRateHz, key("rate of the sentences", "Hz")] = 5.0

    @model_validator(mode="after")
    def _check_receivers(self) -> NmeaTable:
        if not (self.tcp_port or self.udp):
            raise ValueError("tcp_port or udp is required")
        return self


class Gdl90Table(StrictModel):
    """``[publish.gdl90]``: GDL 90 messages for tablets, over UDP."""

    udp: Annotated[
        Receivers,
        Field(min_length=1),
        key("address and port of each receiver of datagrams; tablets have port 4000", NO_UNIT, ("192.168.10.30:4000",)),
    ]
    rate_hz: Annotated[LiveRateHz, key("rate of the attitude; the other messages have 1 Hz", "Hz")] = 5.0


class MavlinkTable(StrictModel):
    """``[publish.mavlink]``: MAVLink 2 for QGroundControl and others, over UDP; commands are not read."""

    udp: Annotated[
        Receivers,
        Field(min_length=1),
        key("address and port of each receiver of datagrams", NO_UNIT, ("192.168.10.40:14550",)),
    ]
    system: Annotated[
        int, Field(ge=1, le=255), key("system id, different from those of autopilots and ground stations", NO_UNIT)
    ] = 100
    component: Annotated[
        int, Field(ge=1, le=255), key("component id; QGroundControl shows only component 1 as a vehicle", NO_UNIT)
    ] = 1
    rate_hz: Annotated[LiveRateHz, key("rate of position, attitude and height", "Hz")] = 10.0


class ZenohTable(TlsKeys):
    """``[publish.zenoh]``: JSON to a zenoh router, usually on the ground, keys ``fti/<aircraft>/<session>/...``.

    It connects to the router and never listens.  The newest value of each topic, and lost events, can be queried.
    """

    connect: Annotated[
        str,
        Field(pattern=ROUTER_PATTERN),
        key(
            "endpoint of the router in zenoh notation; tls checks its certificate and name", NO_UNIT, "tls/ground:7447"
        ),
    ]
    user: Annotated[str | None, key("user name; none: no login", NO_UNIT, "aircraft")] = None
    password_file: Annotated[
        str | None,
        key("text file with the password in its first line, readable by its owner only", NO_UNIT, "zenoh.password"),
    ] = None
    topics: Annotated[TopicPatterns, key("patterns of the topics to send; * stands for any characters", NO_UNIT)] = (
        "*",
    )
    max_rate_hz: Annotated[
        RateHz, key("largest rate of each topic; events are always sent; 0.5 for a radio of 9.6 kbit/s", "Hz")
    ] = 10.0

    @model_validator(mode="after")
    def _check_login(self) -> ZenohTable:
        protocol, _, address = self.connect.partition("/")
        if not 1 <= (port := int(address.rpartition(":")[2])) <= MAX_PORT:
            raise ValueError(f"connect: port {port}; allowed is 1 to {MAX_PORT}")
        if (self.user is None) != (self.password_file is None):
            raise ValueError("user and password_file must both be given, or neither")
        if self.user and protocol != "tls" and address.rpartition(":")[0] not in LOOPBACK_HOSTS:
            raise ValueError("password_file needs an endpoint tls/...")
        if protocol != "tls" and (self.ca_file or self.certificate):
            raise ValueError("ca_file and certificate need an endpoint tls/...")
        return self


class FoxgloveTable(StrictModel):
    """``[publish.foxglove]``: live server for Foxglove, on this computer only (127.0.0.1).

    Foxglove's server has no login; ``ssh -L 8765:127.0.0.1:8765`` reaches it from another computer.
    """

    port: Annotated[Port, key("port on which Foxglove connects", NO_UNIT)] = 8765
    max_rate_hz: Annotated[RateHz, key("largest rate of each topic; events are always sent", "Hz")] = 25.0


class Publish(StrictModel):
    """``[publish]``: sinks that send outputs, health, alarms and events to other programs.

    A sink sends only: what its peers send is never a command.  It never delays recording, navigation or another sink.
    """

    aircraft: Annotated[
        str | None,
        Field(pattern=AIRCRAFT_PATTERN),
        key("name of the aircraft for receivers of several aircraft; none: session.name", NO_UNIT, "D-EFTI"),
    ] = None
    mqtt: Annotated[MqttTable | None, key("[publish.mqtt]: MQTT broker; none: none", NO_UNIT)] = None
    zenoh: Annotated[ZenohTable | None, key("[publish.zenoh]: zenoh router; none: none", NO_UNIT)] = None
    nmea: Annotated[NmeaTable | None, key("[publish.nmea]: NMEA 0183 for gpsd and maps; none: none", NO_UNIT)] = None
    gdl90: Annotated[Gdl90Table | None, key("[publish.gdl90]: GDL 90 for tablets; none: none", NO_UNIT)] = None
    mavlink: Annotated[MavlinkTable | None, key("[publish.mavlink]: MAVLink for ground stations", NO_UNIT)] = None
    foxglove: Annotated[
        FoxgloveTable | None, key("[publish.foxglove]: live server for Foxglove; none: none", NO_UNIT)
    ] = None

    def with_paths(self, absolute: Callable[[str], str]) -> Publish:
        """The same table with the paths of its files changed by a function."""
        changes: dict[str, Any] = {}
        for name, table in self:
            if isinstance(table, StrictModel):
                files = {key: absolute(path) for key, path in table if key in FILE_KEYS and path is not None}
                changes[name] = table.model_copy(update=files)
        return self.model_copy(update=changes)
