"""A cable of two ptys."""

from __future__ import annotations

from pathlib import Path

import serial

from fti.testing.recorder import PtyPair

EVERY_BYTE = bytes(range(256))


def test_every_byte_arrives_in_both_directions(tmp_path: Path) -> None:
    ends = tmp_path / "a" / "line", tmp_path / "b" / "line"
    cable = PtyPair(ends)
    try:
        with serial.Serial(str(ends[0]), timeout=10) as one, serial.Serial(str(ends[1]), timeout=10) as other:
            one.write(EVERY_BYTE)
            assert other.read(256) == EVERY_BYTE
            other.write(EVERY_BYTE)
            assert one.read(256) == EVERY_BYTE
        with serial.Serial(str(ends[0]), timeout=10) as one, serial.Serial(str(ends[1]), timeout=10) as other:
            one.write(b"again")
            assert other.read(5) == b"again"
    finally:
        cable.close()


def test_an_end_that_nobody_reads_stops_nothing(tmp_path: Path) -> None:
    ends = tmp_path / "a", tmp_path / "b"
    cable = PtyPair(ends)
    try:
        with serial.Serial(str(ends[0]), write_timeout=10) as one:
            for _ in range(500):
                one.write(EVERY_BYTE)
            with serial.Serial(str(ends[1])) as other:
                other.write(b"answer")
                one.timeout = 10
                assert one.read(6) == b"answer"
    finally:
        cable.close()
