"""The framing that all drivers share."""

from __future__ import annotations

from fti.drivers import Counters
from fti.drivers._framing import Framer, Skip, skip_to


def measure(buffer: bytearray) -> int | Skip:
    """Frames of the test: AA 55, a length byte (of all of it), content."""
    if skip := skip_to(buffer, b"\xaa\x55"):
        return skip
    if len(buffer) < 3:
        return 0
    length = buffer[2]
    if length < 3:
        return Skip(1, "bad_length")
    return length if len(buffer) >= length else 0


def run(reads: list[tuple[bytes, int]], limit: int = 64) -> tuple[list[tuple[int, bytes]], Counters]:
    counters = Counters()
    framer = Framer(measure, counters, limit)
    return [found for data, t in reads for found in framer.feed(data, t)], counters


FRAME = b"\xaa\x55\x05xy"


def test_a_frame_that_begins_a_read_has_the_stamp_of_that_read() -> None:
    found, _ = run([(FRAME, 100), (FRAME, 200), (FRAME, 300)])
    assert [t for t, _ in found] == [100, 200, 300]


def test_a_frame_over_three_reads_has_the_stamp_of_the_first() -> None:
    found, counters = run([(FRAME[:1], 100), (FRAME[1:3], 200), (FRAME[3:] + FRAME[:2], 300), (FRAME[2:], 400)])
    assert [t for t, _ in found] == [100, 300]
    assert counters.framed == 2 * len(FRAME)
    assert counters.held == 0


def test_frames_held_back_by_a_false_header_keep_their_own_stamps() -> None:
    def checked(buffer: bytearray) -> int | Skip:
        """No frame of this protocol is longer than ten bytes, and that shows at its end only."""
        measurements = measure(buffer)
        return Skip(1, "bad_checksum") if isinstance(measurements, int) and measurements > 10 else measurements

    counters = Counters()
    framer = Framer(checked, counters, 64)
    reads = [(b"\xaa\x55\x28", 1), (FRAME, 2), (FRAME, 3), (b"." * 30, 4)]
    assert [t for data, at in reads for t, _ in framer.feed(data, at)] == [2, 3]
    assert counters.skipped == {"bad_checksum": 1, "no_sync": 32}


def test_what_is_held_is_bounded_and_given_up_byte_by_byte() -> None:
    _, counters = run([(b"\xaa\x55\xff" + b"." * 100, 1)], limit=16)
    assert counters.skipped == {"too_long": 1, "no_sync": 102}
    assert counters.held == 0


def test_the_limit_acts_alike_however_the_bytes_are_cut() -> None:
    stream = b"\xaa\x55\x14" + b"." * 17 + FRAME * 3
    whole = run([(stream, 1)], limit=16)
    single = run([(stream[i : i + 1], 1) for i in range(len(stream))], limit=16)
    assert whole == single
    assert [data for _, data in whole[0]] == [FRAME] * 3


def test_half_a_sync_at_the_end_is_held() -> None:
    _, counters = run([(b"noise\xaa", 1)])
    assert counters.held == 1
    assert counters.skipped == {"no_sync": 5}


def test_an_empty_read_changes_nothing() -> None:
    found, counters = run([(b"", 1), (FRAME[:2], 2), (b"", 3), (FRAME[2:], 4)])
    assert found == [(2, FRAME)]
    assert counters.bytes_in == len(FRAME)
