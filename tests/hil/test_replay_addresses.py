"""A replay by the configuration of the recording stays on this machine, unless the user says otherwise."""

from __future__ import annotations

import contextlib
import re
import socket
from pathlib import Path

import pytest

from fti.cli.main import main
from fti.config import CanLink, Link, UdpLink
from fti.errors import ConfigError
from fti.hil.replay_addresses import check_links
from tests.hil.test_replay import frames, record

SESSION = '[session]\nname = "replayed"\n\n[[link]]\nname = "eth"\nkind = "udp"\n'
ALLOWED: list[Link] = [
    UdpLink(name="a", kind="udp", bind="127.0.0.1:5000", source="127.0.0.2", peer="127.0.0.1:5001"),
    UdpLink(name="b", kind="udp", bind="0.0.0.0:5000"),
    UdpLink(name="c", kind="udp", bind="[::1]:5000"),
    UdpLink(name="d", kind="udp", bind="0.0.0.0:5000", group="239.1.2.3"),
    CanLink(name="e", kind="can", interface="slcan", channel="/dev/ttyACM0"),
    CanLink(name="f", kind="can", interface="socketcan", channel="vcan0"),
    CanLink(name="g", kind="can", interface="udp_multicast", channel="239.74.163.2", settings={"port": 4711}),
    CanLink(name="h", kind="can", interface="udp_multicast", channel="ff15:7079:7468:6f6e:6465:6d6f:6d63:6173"),
    CanLink(name="i", kind="can", interface="virtual", channel="x"),
]
REFUSED: list[tuple[Link, str]] = [
    (UdpLink(name="a", kind="udp", bind="192.0.2.1:5000", source="0.0.0.0"), "bind = '192.0.2.1:5000'"),
    (UdpLink(name="b", kind="udp", bind="127.0.0.1:5000", peer="192.0.2.1:5000"), "peer = '192.0.2.1:5000'"),
    (UdpLink(name="c", kind="udp", bind="127.0.0.1:5000", source="example.org"), "source = 'example.org'"),
    (UdpLink(name="d", kind="udp", bind="0.0.0.0:5000", group="192.0.2.1"), "group = '192.0.2.1'"),
    (UdpLink(name="e", kind="udp", bind="[::]:5000", group="ff02::1"), "group = 'ff02::1'"),
    (CanLink(name="f", kind="can", interface="socketcan", channel="can0"), "channel = 'socketcan:can0'"),
    (CanLink(name="g", kind="can", interface="udp_multicast", channel="192.0.2.1"), "channel = 'udp_multicast"),
    (CanLink(name="h", kind="can", interface="pcan", channel="PCAN_USBBUS1"), "channel = 'pcan:PCAN_USBBUS1'"),
    (CanLink(name="i", kind="can", interface="virtual", channel="x", settings={"rtscts": 1}), "settings.rtscts = '1'"),
]


@pytest.mark.parametrize("link", ALLOWED, ids=lambda link: link.name)
def test_what_stays_here_is_allowed(link: Link) -> None:
    refused, named = REFUSED[0]
    with pytest.raises(ConfigError, match=re.escape(f"link {refused.name!r}: the recording names {named}")):
        check_links([link, refused], "session")


@pytest.mark.parametrize(("link", "named"), REFUSED, ids=lambda value: getattr(value, "name", ""))
def test_what_leads_away_is_refused_and_named(link: Link, named: str) -> None:
    with pytest.raises(ConfigError) as refused:
        check_links([link], "session")
    assert str(refused.value).startswith(f"session: link {link.name!r}: the recording names {named}")
    assert "--allow-remote" in str(refused.value)
    assert "--config" in str(refused.value)


@pytest.mark.parametrize("by_user", ["--allow-remote", "--config", "--only"])
def test_nothing_is_sent_by_a_recording_that_the_user_did_not_allow(
    tmp_path: Path, by_user: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SESSION + 'bind = "192.0.2.1:5000"\nsource = "0.0.0.0"\n' + '\n[[link]]\nname = "bus"\nkind = "can"\n'
    recorded = [frame for frame in frames(30) if frame.link != "line"]
    session = record(tmp_path, text + 'interface = "virtual"\nchannel = "x"\n', recorded)
    own = tmp_path / "own.toml"
    own.write_text(text + 'interface = "virtual"\nchannel = "x"\n')
    targets: list[object] = []

    class Socket(socket.socket):
        def sendto(self, data: bytes, target: object) -> int:  # type: ignore[override]
            targets.append(target)
            return len(data)

    monkeypatch.setattr(socket, "socket", Socket)
    monkeypatch.setattr("fti.cli._keyboard.handle_keys", lambda _: contextlib.nullcontext())
    call = ["replay", str(session), "--links", str(tmp_path / "links"), "--wait", "0"]
    assert main(call) == 2
    assert "bind = '192.0.2.1:5000'" in capsys.readouterr().err
    assert targets == []
    more = {"--allow-remote": [by_user], "--config": [by_user, str(own)], "--only": [by_user, "bus"]}[by_user]
    monkeypatch.setattr("fti.hil.ports.endpoints._is_bound", lambda port: True)
    assert main([*call, *more]) == 0
    assert set(targets) == (set() if by_user == "--only" else {("192.0.2.1", 5000)})
