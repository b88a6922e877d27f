"""``fti ports``: what is there, and in which state."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from fti.cli.main import main
from fti.links import ports
from tests.links.bench import Peer


def test_lists_addresses_one_per_line_name_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ports"]) == 0
    (line,) = [text for text in capsys.readouterr().out.splitlines() if text.startswith("127.0.0.1 ")]
    assert line.split() == ["127.0.0.1", "udp", "up", "lo"]


def test_ports_of_an_emulator_and_their_state(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    peer = Peer(tmp_path / "radalt_line")
    (tmp_path / "gone").symlink_to("/dev/pts/none")
    try:
        assert main(["ports", "--links", str(tmp_path), "--json"]) == 0
        found = {port["name"]: port for port in json.loads(capsys.readouterr().out)}
    finally:
        peer.power_off()
    assert found[str(peer.path)]["state"] == "free"  # only the process of its other end holds it open
    assert found[str(peer.path)]["kind"] == "serial"
    assert str(tmp_path / "gone") not in found


def test_port_that_nobody_has_open_is_free_and_one_without_permission_denied(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = tmp_path / "line"
    device.symlink_to("/dev/full")
    assert [p.state for p in ports.serial_ports(tmp_path) if p.name == str(device)] == ["free"]
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may do everything
    (denied,) = [p for p in ports.serial_ports(tmp_path) if p.name == str(device)]
    assert denied.state == "denied"
    assert "group " in denied.detail


def test_can_interfaces_are_reported_by_their_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, kind, flags in (("can0", "280", "0x40080"), ("can1", "280", "0x40081"), ("eth0", "1", "0x1003")):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "type").write_text(kind + "\n")
        (folder / "flags").write_text(flags + "\n")
    monkeypatch.setattr(ports, "NET", tmp_path)
    assert [(p.name, p.state) for p in ports.can_interfaces()] == [("can0", "down"), ("can1", "up")]


def test_folder_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ports", "--links", str(tmp_path / "no")]) == 2
    assert "no such folder" in capsys.readouterr().err
