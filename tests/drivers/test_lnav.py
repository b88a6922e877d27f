"""Ephemerides of RAWEPHEM and RXM-SFRBX compared with rtklib on the same bytes."""

from __future__ import annotations

import math
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from fti.drivers import novatel_oem6 as novatel
from fti.drivers import ublox_ubx as ublox
from fti.messages.measurements import Ephemeris, Measurement
from tests.helpers import ROOT

CAPTURE = ROOT / "tests/captures/novatel_oemv_part1.gps"
#: In the order of a RINEX record; what the product does not keep is None.
ROWS = (
    "af0", "af1", "af2",
    "issue", "crs", "delta_n", "m0",
    "cuc", "e", "cus", "sqrt_a",
    "toe", "cic", "omega0", "cis",
    "i0", "crc", "omega", "omega_dot",
    "idot", None, "week", None,
    None, None, "tgd", "issue",
)  # fmt: skip


def rawephems() -> list[bytes]:
    """Bodies of the nine RAWEPHEM of the capture."""
    data, found, at = CAPTURE.read_bytes(), [], 0
    while (at := data.find(b"\xaa\x44\x12", at)) >= 0:
        head = data[at + 3]
        message, size = struct.unpack_from("<H", data, at + 4)[0], struct.unpack_from("<H", data, at + 8)[0]
        if message == 41:
            found.append(data[at + head : at + head + size])
        at += 3
    return found


def sfrbx(number: int, subframe: bytes, signal_id: int = 0) -> bytes:
    """RXM-SFRBX of a subframe without parity: each word at the upper end of 30 bits, the others set."""
    words = [3 << 30 | int.from_bytes(subframe[at : at + 3], "big") << 6 | 0x3F for at in range(0, 30, 3)]
    payload = struct.pack("<8B10I", 0, number, signal_id, 0, 10, 1, 2, 0, *words)
    body = struct.pack("<BBH", 0x02, 0x13, len(payload)) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) & 0xFF
        b = (b + a) & 0xFF
    return b"\xb5\x62" + body + bytes((a, b))


def as_ublox(signal_id: int = 0) -> bytes:
    """Subframes of the capture as a u-blox receiver sends them: 1 of all satellites, then 2, then 3."""
    bodies = rawephems()
    return b"".join(sfrbx(body[0], body[12 + 30 * k : 42 + 30 * k], signal_id) for k in range(3) for body in bodies)


def ephemerides(measurements: list[Measurement]) -> dict[int, Ephemeris]:
    return {m.number: m for m in measurements if isinstance(m, Ephemeris)}


def of_novatel() -> dict[int, Ephemeris]:
    return ephemerides(novatel.make_decoder(novatel.Options()).feed(CAPTURE.read_bytes(), 1))


def of_ublox(data: bytes) -> dict[int, Ephemeris]:
    return ephemerides(ublox.make_decoder(ublox.Options()).feed(data, 1))


def rinex_nav(data: bytes, kind: str, folder: Path) -> dict[int, list[float]]:
    """Numbers of each GPS record that rtklib's convbin writes."""
    convbin = shutil.which("convbin")
    if convbin is None:
        pytest.skip("convbin (Debian: rtklib) is not installed; it is the independent decoder")
    raw, obs, nav = folder / "raw.bin", folder / "raw.obs", folder / "raw.nav"
    raw.write_bytes(data)
    # rtklib takes the week of u-blox subframes from an approximate time
    command = [convbin, "-r", kind, "-v", "3.03", "-tr", "2009/12/18", "23:07:00", "-o", str(obs), "-n", str(nav)]
    subprocess.run([*command, str(raw)], check=True, capture_output=True, timeout=120)
    lines = nav.read_text().partition("END OF HEADER")[2].splitlines()[1:]
    found = {}
    for at, line in enumerate(lines):
        if line.startswith("G"):
            text = line[23:].ljust(57) + "".join(row[4:80].ljust(76) for row in lines[at + 1 : at + 8])
            cells = [text[i : i + 19].strip().replace("D", "e") for i in range(0, len(text), 19)]
            found[int(line[1:3])] = [float(cell) for cell in cells if cell]
    return found


def assert_same(mine: Ephemeris, numbers: list[float]) -> None:
    """Twelve digits are written; RINEX counts weeks on, and issues are those of the clock, too."""
    for name, value in zip(ROWS, numbers, strict=False):
        if name == "week":
            assert mine.week == value % 1024
        elif name is not None:
            assert getattr(mine, name) == pytest.approx(value, rel=1e-11, abs=1e-22), name


def test_ephemerides_of_a_novatel_receiver_are_those_of_rtklib(tmp_path: Path) -> None:
    theirs, ours = rinex_nav(CAPTURE.read_bytes(), "nov", tmp_path), of_novatel()
    assert theirs.keys() == ours.keys() == {3, 6, 7, 8, 11, 13, 16, 19, 22}
    for number, numbers in theirs.items():
        assert_same(ours[number], numbers)
        assert ours[number].healthy
        assert ours[number].accuracy in (2.4, 3.4)


def test_subframes_of_a_ublox_receiver_give_the_ephemerides_that_rtklib_reads(tmp_path: Path) -> None:
    """The subframes are those that the other receiver received; words, order and signals are of u-blox."""
    theirs, ours = rinex_nav(as_ublox(), "ubx", tmp_path), of_ublox(as_ublox())
    assert theirs.keys() == ours.keys()
    assert len(ours) == 9
    for number, numbers in theirs.items():
        assert_same(ours[number], numbers)


def test_an_ephemeris_is_of_one_issue_and_complete() -> None:
    """Subframe 2 of another issue, in between; then the third subframe of the first issue again."""
    body = rawephems()[0]
    parts = [body[12 + 30 * k : 42 + 30 * k] for k in range(3)]
    other = bytearray(parts[1])
    other[6] ^= 0xFF  # IODE
    number = body[0]
    assert of_ublox(sfrbx(number, parts[0]) + sfrbx(number, parts[2])) == {}
    mixed = sfrbx(number, parts[0]) + sfrbx(number, bytes(other)) + sfrbx(number, parts[2])
    assert of_ublox(mixed) == {}
    assert of_ublox(mixed + sfrbx(number, parts[1])).keys() == {number}
    assert of_ublox(sfrbx(number, parts[0]) + sfrbx(number + 1, parts[1]) + sfrbx(number, parts[2])) == {}


def test_other_signals_and_damaged_subframes_give_none() -> None:
    assert of_ublox(as_ublox(signal_id=3)) == {}  # L2 CL: another message
    body = rawephems()[0]
    parts = [bytes([0x8A]) + body[13 + 30 * k : 42 + 30 * k] for k in range(3)]
    assert of_ublox(b"".join(sfrbx(body[0], part) for part in parts)) == {}


@pytest.mark.parametrize(("subframe", "byte", "bit"), [(0, 8, 2), (1, 5, 6), (2, 5, 6)])
def test_health_and_alert_flags_are_heeded(subframe: int, byte: int, bit: int) -> None:
    """Health: bits 17 to 22 of word 3 of subframe 1; alert: bit 18 of the hand-over word of each."""
    body = rawephems()[0]
    parts = [bytearray(body[12 + 30 * k : 42 + 30 * k]) for k in range(3)]
    parts[subframe][byte] |= 1 << bit
    ephemeris = of_ublox(b"".join(sfrbx(body[0], bytes(part)) for part in parts))
    assert [m.healthy for m in ephemeris.values()] == [False]


def test_a_satellite_that_predicts_no_accuracy_has_none() -> None:
    body = rawephems()[0]
    parts = [bytearray(body[12 + 30 * k : 42 + 30 * k]) for k in range(3)]
    parts[0][7] |= 0x0F  # bits 13 to 16 of word 3
    (found,) = of_ublox(b"".join(sfrbx(body[0], bytes(part)) for part in parts)).values()
    assert found.accuracy is None
    assert math.isfinite(found.af0)
