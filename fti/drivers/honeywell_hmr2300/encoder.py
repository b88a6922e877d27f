"""The emulated HMR2300: samples, and an answer to every command."""

from __future__ import annotations

import re

from fti.drivers.honeywell_hmr2300.commands import BROADCAST_ID, ESCAPE, RATES, Options
from fti.drivers.honeywell_hmr2300.framing import FULL_SCALE
from fti.messages.measurements import MagneticField, Measurement

COUNTS_PER_TESLA = 15_000 / 1e-4
MAX_COMMAND_LETTERS = 10
LINE = re.compile(rb"\x1b|\*[^\r\x1b]*\r|[^\r\x1b*][^\r\x1b]*\r|\r")
MAX_HELD_BYTES = 256
Counts = tuple[int, int, int]


def encode_binary(counts: Counts) -> bytes:
    """A binary sample."""
    return b"".join(count.to_bytes(2, "big", signed=True) for count in counts) + b"\r"


def encode_ascii(counts: Counts) -> bytes:
    """An ASCII sample."""
    return "".join(f"{'-' if c < 0 else ' '}{abs(c):6,d}  " for c in counts).encode("ascii") + b"\r"


class Encoder:
    """An HMR2300 whose stored settings are those of the options."""

    def __init__(self, options: Options) -> None:
        self._id = 0 if options.id == BROADCAST_ID else options.id
        self._format: str = options.format
        self._rate: int = options.rate
        self._stored: tuple[str, int] = (self._format, self._rate)
        self._streams = options.mode == "continuous"
        self._switches = {"S/R": True, "ZERO": False, "AVG": False}
        self._re_enter = True
        self._enabled = False
        self._baud = "9600"
        self._raw = self._zero = self._mean = (0, 0, 0)
        self._sample: Counts | None = None
        self._pulse = "SET"
        self._pending = b""

    # ------------------------------------------------------------------------------------------------------- samples

    def encode(self, measurement: Measurement) -> list[bytes]:
        if not isinstance(measurement, MagneticField):
            return []
        x, y, z = (max(-FULL_SCALE, min(FULL_SCALE, round(b * COUNTS_PER_TESLA))) for b in measurement.field_b)
        self._update((x, y, z))
        return self._sample_bytes() if self._streams else []

    def _update(self, raw: Counts) -> None:
        """Subtract the zero reading and update the average, X(N)/2 + X(N-1)/4 + ..."""
        a, b, c = (r - z for r, z in zip(raw, self._zero, strict=True))
        x, y, z = ((new + old) // 2 for new, old in zip((a, b, c), self._mean, strict=True))
        self._raw = raw
        self._mean = (x, y, z) if self._sample else (a, b, c)
        self._sample = self._mean if self._switches["AVG"] else (a, b, c)

    def _sample_bytes(self) -> list[bytes]:
        if self._sample is None:
            return []
        return [(encode_binary if self._format == "binary" else encode_ascii)(self._sample)]

    # ------------------------------------------------------------------------------------------------------- answers

    def respond(self, data: bytes) -> list[bytes]:
        self._pending += data
        answers: list[bytes] = []
        at = 0
        for match in LINE.finditer(self._pending):
            at = match.end()
            answers += self._handle_line(match[0])
        self._pending = self._pending[at:][-MAX_HELD_BYTES:]
        return answers

    def _handle_line(self, line: bytes) -> list[bytes]:
        if line == ESCAPE:
            self._streams = False
            return []
        text = line[:-1].decode("latin-1")
        called = re.match(r"\*(\d\d)", text)
        if called and int(called[1]) not in (self._id, BROADCAST_ID):
            return []
        if called is None or len(text) > MAX_COMMAND_LETTERS + 1:
            return self._refuse()
        return self._execute(text[3:].upper(), to_all=int(called[1]) == BROADCAST_ID)

    def _refuse(self) -> list[bytes]:
        return [b"Re-enter\r"] if self._re_enter else []

    def _execute(self, letters: str, *, to_all: bool) -> list[bytes]:
        if letters == "P":
            return self._sample_bytes()
        if letters == "C":
            self._streams = True
            return []
        answers = self._answer_query(letters, to_all=to_all)
        if answers is None:
            enabled, self._enabled = self._enabled, False
            if enabled:
                return self._set(letters, to_all=to_all)
            is_known = re.fullmatch(r"[ABDYN]|RST|SP|[TZV][NF]?|ZR|R=\d+|ID=\d\d|!BR=[SF]", letters)
            return [b"WE OFF\r"] if is_known else self._refuse()
        return answers

    def _answer_query(self, letters: str, *, to_all: bool) -> list[bytes] | None:
        """Answers to commands that change no setting; None for others."""
        if letters == "WE":
            self._enabled = True
            return [b"OK\r"]
        if letters.startswith("]"):
            other = "RST" if self._pulse == "SET" else "SET"
            self._pulse = {"S": "SET", "R": "RST", "": other}.get(letters[1:], "")
            return [self._pulse.encode("ascii") + b"\r"] if self._pulse else self._refuse()
        if letters == "ID=" and to_all:
            return [b"ID= %02d\r" % self._id]
        texts = {"#": "SER# 0001", "F": "S/W vers: 1.0", "H": "H/W vers: 1.0", "Q": self._settings()}
        return [texts[letters].encode("ascii") + b"\r"] if letters in texts else None

    def _settings(self) -> str:
        switches = ", ".join(f"{name} {'ON' if on else 'OFF'}" for name, on in self._switches.items())
        mode, answers = "CONT" if self._streams else "POLLED", "ON" if self._re_enter else "OFF"
        return f"{self._format.upper()}, {mode}, {switches}, R {answers}, ID={self._id:02d}, {self._rate} sps"

    def _set(self, letters: str, *, to_all: bool) -> list[bytes]:
        """A command that changes a setting, after its write enable."""
        if letters in ("A", "B"):
            self._format = "ascii" if letters == "A" else "binary"
            return [b"ASCII ON\r" if letters == "A" else b"BINARY ON\r"]
        if match := re.fullmatch(r"([TZV])([NF]?)|(ZR)", letters):
            return self._switch({"T": "S/R", "Z": "ZERO", "V": "AVG"}[letters[0]], match[2] or "")
        if match := re.fullmatch(r"R=(\d{1,3})", letters):
            is_allowed = int(match[1]) in RATES
            self._rate = int(match[1]) if is_allowed else self._rate
            return [b"OK\r"] if is_allowed else self._refuse()
        if match := re.fullmatch(r"ID=(\d\d)", letters):
            is_allowed = int(match[1]) != BROADCAST_ID
            self._id = int(match[1]) if is_allowed else self._id
            return [b"OK\r"] if is_allowed else self._refuse()
        if match := re.fullmatch(r"!BR=([SF])", letters) if to_all else None:
            self._baud = "9600" if match[1] == "S" else "19,200"
            return [b"OK\r", self._baud_bytes()]
        return self._keep(letters)

    def _switch(self, name: str, how: str) -> list[bytes]:
        on = {"N": True, "F": False}.get(how, not self._switches[name])
        self._switches[name] = on
        if name == "ZERO":
            self._zero = self._raw if on else (0, 0, 0)
        return [f"{name} {'ON' if on else 'OFF'}\r".encode("ascii")]

    def _keep(self, letters: str) -> list[bytes]:
        """Store and restore settings, factory settings, answers to unknown commands."""
        if letters in ("Y", "N"):
            self._re_enter = letters == "Y"
            return [b"OK\r"]
        if letters == "SP":
            self._stored = (self._format, self._rate)
            return [b"DONE\r", b"OK\r"]
        if letters not in ("D", "RST"):
            return self._refuse()
        self._format, self._rate = self._stored if letters == "RST" else ("ascii", 20)
        self._streams = False
        return [b"OK\r", self._baud_bytes()]

    def _baud_bytes(self) -> bytes:
        return f"BAUD= {self._baud}\r".encode("ascii")
