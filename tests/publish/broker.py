"""A mosquitto broker and a mosquitto_sub client, on loopback."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import threading
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from fti.bus.loopback import choose_port
from tests.helpers import until

PATHS = f"{os.environ.get('PATH', '')}:/usr/sbin"


def find_program(name: str, package: str) -> str:
    """Path of a program; skips the test without it."""
    path = shutil.which(name, path=PATHS)
    if path is None:
        pytest.skip(f"{name} (Debian: {package}) is not installed")
    return path


#: A retained message that each reader receives first.
READY = "test/ready"


class Received(NamedTuple):
    """A message as mosquitto_sub has received it."""

    topic: str
    is_retained: bool
    qos: int
    fields: dict[str, Any]


class Broker:
    """mosquitto without persistence: a restart forgets retained messages.

    settings : more lines of its configuration;  login : user and password that it requires
    """

    def __init__(self, folder: Path, settings: str = "", login: tuple[str, str] | None = None) -> None:
        self.port = choose_port(0)
        self._program = find_program("mosquitto", "mosquitto")
        self._config = folder / "mosquitto.conf"
        if login:
            passwords = folder / "passwords"
            command = [find_program("mosquitto_passwd", "mosquitto"), "-c", "-b", str(passwords), *login]
            subprocess.run(command, check=True, capture_output=True)
            passwords.chmod(0o644)
            settings += f"password_file {passwords}\n"
        access = "allow_anonymous false" if login else "allow_anonymous true"
        self._config.write_text(f"listener {self.port} 127.0.0.1\nuser root\n{access}\n{settings}")
        self.start()

    def start(self) -> None:
        """Start it, and wait until it listens."""
        self._process = subprocess.Popen([self._program, "-c", str(self._config)], stderr=subprocess.DEVNULL)
        until(self._accepts, what="mosquitto")

    def _accepts(self) -> bool:
        assert self._process.poll() is None, "mosquitto has ended"
        with socket.socket() as sock:
            return sock.connect_ex(("127.0.0.1", self.port)) == 0

    def kill(self) -> None:
        """Kill it."""
        self._process.kill()
        self._process.wait()

    def pause(self) -> None:
        """Stop it; its connections stay open."""
        self._process.send_signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Continue after ``pause``."""
        self._process.send_signal(signal.SIGCONT)


class MqttReader:
    """mosquitto_sub with QoS 1.  messages : all that it has received"""

    def __init__(self, broker: Broker, topic: str = "#", options: tuple[str, ...] = ()) -> None:
        program = find_program("mosquitto_sub", "mosquitto-clients")
        command = [program, "-h", "127.0.0.1", "-p", str(broker.port), "-t", topic, "-q", "1", "-F", "%t\t%r\t%q\t%p"]
        self._process = subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True)
        self.messages: list[Received] = []
        self._is_subscribed = threading.Event()
        self._thread = threading.Thread(target=self._read)
        self._thread.start()
        subprocess.run(
            ["mosquitto_pub", "-h", "127.0.0.1", "-p", str(broker.port), "-r", "-t", READY, "-m", "{}", *options],
            check=True,
        )
        assert self._is_subscribed.wait(20.0)

    def _read(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            topic, retained, qos, payload = line.rstrip("\n").split("\t", 3)
            if topic == READY:
                self._is_subscribed.set()
            else:
                self.messages.append(Received(topic, retained == "1", int(qos), json.loads(payload)))

    def of(self, ending: str) -> list[dict[str, Any]]:
        """Contents of the messages whose topic has an ending."""
        return [message.fields for message in [*self.messages] if message.topic.endswith(ending)]

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()
        self._thread.join()
        assert self._process.stdout
        self._process.stdout.close()
