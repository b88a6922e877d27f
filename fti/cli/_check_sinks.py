"""The sinks of ``[publish]`` in ``fti check``: where each sends to, what, how often, and how it is protected."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fti.config import Config, FoxgloveTable, MqttTable, Publish, TlsKeys, ZenohTable
    from fti.config.publish_tables import Gdl90Table, MavlinkTable, NmeaTable

#: Where it sends to, what it sends, rate [Hz], and protection.
Words = tuple[str, str, float, str]
LOOPBACK, PLAIN = "on this computer only", "not encrypted"


def describe_sinks(config: Config) -> list[dict[str, Any]]:
    """Name, address, content, rate [Hz] and protection of each sink, ready for JSON."""
    publish = config.publish
    if publish is None:
        return []
    names = ("name", "to", "content", "max_rate_hz", "protection")
    found = ((name, getattr(publish, name), describe) for name, describe in DESCRIBE.items())
    return [dict(zip(names, (name, *describe(table)), strict=True)) for name, table, describe in found if table]


def sink_cells(sink: dict[str, Any]) -> tuple[str, ...]:
    """A sink as a row of the text."""
    return (sink["name"], sink["to"], sink["content"], f"at most {sink['max_rate_hz']:g} Hz", sink["protection"])


def _mqtt(table: MqttTable) -> Words:
    protection = _protection(table, is_encrypted=table.tls, user=table.user)
    return f"MQTT broker {table.host}:{table.broker_port}", _topics(table.topics), table.max_rate_hz, protection


def _zenoh(table: ZenohTable) -> Words:
    protection = _protection(table, is_encrypted=table.connect.startswith("tls/"), user=table.user)
    return f"zenoh router {table.connect}", _topics(table.topics), table.max_rate_hz, protection


def _foxglove(table: FoxgloveTable) -> Words:
    return f"listens on 127.0.0.1:{table.port}", _topics(("*",)), table.max_rate_hz, LOOPBACK


def _nmea(table: NmeaTable) -> Words:
    server = [f"listens on 127.0.0.1:{table.tcp_port}"] if table.tcp_port else []
    sentences = f"sentences {', '.join(table.sentences)}"
    return ", ".join((*server, *_datagrams(table.udp))), sentences, table.rate_hz, PLAIN if table.udp else LOOPBACK


def _gdl90(table: Gdl90Table) -> Words:
    return ", ".join(_datagrams(table.udp)), "position, attitude", table.rate_hz, PLAIN


def _mavlink(table: MavlinkTable) -> Words:
    content = f"position, attitude, height, texts as system {table.system}"
    return ", ".join(_datagrams(table.udp)), content, table.rate_hz, PLAIN


#: For each table of ``[publish]``.
DESCRIBE: dict[str, Callable[[Any], Words]] = {
    "mqtt": _mqtt,
    "zenoh": _zenoh,
    "foxglove": _foxglove,
    "nmea": _nmea,
    "gdl90": _gdl90,
    "mavlink": _mavlink,
}


def _datagrams(receivers: tuple[str, ...]) -> Iterator[str]:
    return (f"UDP {receiver}" for receiver in receivers)


def _topics(patterns: tuple[str, ...]) -> str:
    return "all topics" if "*" in patterns else f"topics {', '.join(patterns)}"


def _protection(table: TlsKeys, *, is_encrypted: bool, user: str | None) -> str:
    certificate = ", own certificate" if table.certificate else ""
    login = f", user {user}" if user else ", no login"
    return f"{f'TLS{certificate}' if is_encrypted else PLAIN}{login}"


# --------------------------------------------------------------------------------------------------------- warnings


def sink_warnings(config: Config) -> Iterator[str]:
    """Sinks that cannot work as they are configured; files and other programs may come before the start."""
    publish = config.publish
    if publish is None:
        return
    if not any(getattr(publish, name) for name in DESCRIBE):
        tables = ", ".join(f"[publish.{name}]" for name in DESCRIBE)
        yield f"publish: sends nothing: it has no sink; add one of {tables}"
    yield from _used_ports(config, publish)
    for name in ("mqtt", "zenoh"):
        if table := getattr(publish, name):
            yield from _unreadable_files(table, f"publish.{name}")


def _used_ports(config: Config, publish: Publish) -> Iterator[str]:
    """Servers of loopback with the same port; the second one would find it busy."""
    servers = {
        "display.port": config.display.port if config.display.enabled else 0,
        "bus.port": config.bus.port if config.bus.enabled else 0,
        "publish.nmea.tcp_port": (publish.nmea and publish.nmea.tcp_port) or 0,
        "publish.foxglove.port": publish.foxglove.port if publish.foxglove else 0,
    }
    owners: dict[int, str] = {}
    for key, port in servers.items():
        if port and port in owners:
            yield f"{key} = {port}: is also {owners[port]}: one of the two servers cannot listen; choose another port"
        owners.setdefault(port, key)


def _unreadable_files(table: MqttTable | ZenohTable, name: str) -> Iterator[str]:
    from fti.publish.files import make_tls_context, read_password
    from fti.publish.sink import SinkError

    try:
        if table.password_file:
            read_password(table.password_file, f"{name}.password_file")
        if table.ca_file or table.certificate:
            make_tls_context(table, name)
    except SinkError as error:
        yield str(error)
