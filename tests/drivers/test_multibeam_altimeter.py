"""Frames of the multi-beam altimeter: what is lost, what is invalid, what the emulated one sends."""

from __future__ import annotations

import math

from fti.drivers.multibeam_altimeter import FLAGS, MAX_BEAMS, Header, Options, make_decoder, make_encoder, make_frame
from fti.messages.measurements import BeamRange, DeviceStatus, Measurement, Stamp, TimeScale

S = Stamp(1, 5_000_000, TimeScale.BOOT)


def beams(count: int, slant_range: float | None = 12.5) -> list[Measurement]:
    return [
        BeamRange(stamp=S, beam=f"beam_{k}", along=0.0, across=0.01 * k, slant_range=slant_range)
        for k in range(1, count + 1)
    ]


def send(*measurements: Measurement) -> list[bytes]:
    encoder = make_encoder(Options())
    return [frame for m in measurements for frame in encoder.encode(m)]


def status(*flags: str, ok: bool = True) -> DeviceStatus:
    return DeviceStatus(stamp=S, ok=ok, flags=flags)


def test_missing_sequence_numbers_are_lost_and_a_restart_is_not() -> None:
    decoder = make_decoder(Options())
    for sequence in (7, 8, 11, 12, 0, 1, 5):
        decoder.feed(make_frame(Header(1, 1, sequence, 0, 0), bytes(10)), 1)
    assert decoder.counters.lost == {"ranges": 2 + 3}


def test_all_beams_of_a_frame_have_its_time_and_the_status_comes_last() -> None:
    (frame,) = send(*beams(9), status("temperature", ok=False))
    measurements = make_decoder(Options()).feed(frame, 99)
    assert {m.stamp for m in measurements} == {Stamp(99, 5_000_000, TimeScale.BOOT)}
    assert [m.beam for m in measurements if isinstance(m, BeamRange)] == [f"beam_{k}" for k in range(1, 10)]
    assert measurements[-1] == DeviceStatus(stamp=measurements[0].stamp, ok=False, flags=("temperature",))


def test_a_time_that_no_clock_has_is_not_used() -> None:
    measurements = make_decoder(Options()).feed(make_frame(Header(1, 1, 0, 2**64 - 1, 0), bytes(10)), 7)
    assert [m.stamp for m in measurements] == [Stamp(7)] * 2


def test_the_emulated_altimeter_counts_its_frames_and_sends_none_without_beams() -> None:
    assert send(status()) == []
    first, second = send(*beams(1), status(), *beams(1), status())
    assert (first[8:12], second[8:12]) == (bytes(4), b"\1\0\0\0")


def test_an_altimeter_that_does_not_measure_has_no_valid_beam() -> None:
    expected = {"self_test": False, "temperature": True, "transmitter_off": False, "failure": False}
    for flag, valid in expected.items():
        (frame,) = send(*beams(2), status(flag, ok=False))
        ranges = [m for m in make_decoder(Options()).feed(frame, 1) if isinstance(m, BeamRange)]
        assert [(m.valid, m.slant_range) for m in ranges] == [(valid, 12.5 if valid else None)] * 2


def test_a_failure_without_a_status_bit_of_its_own_is_a_failure() -> None:
    (frame,) = send(*beams(1), status("unknown", ok=False))
    assert frame[20] == 1 << FLAGS.index("failure")


def test_invalid_and_impossible_ranges_are_not_valid() -> None:
    no_return, unknown = beams(1, None)[0], beams(1, math.nan)[0]
    invalid = BeamRange(stamp=S, beam="beam_3", along=0.0, across=0.0, slant_range=9.0, valid=False)
    below = BeamRange(stamp=S, beam="beam_4", along=-9.0, across=9.0, slant_range=-3.0)
    (frame,) = send(no_return, unknown, invalid, below, status())
    found = [m for m in make_decoder(Options()).feed(frame, 1) if isinstance(m, BeamRange)]
    assert [(m.slant_range, m.valid) for m in found] == [(None, False)] * 3 + [(0.0, True)]
    assert [round(math.degrees(angle), 2) for angle in (found[3].along, found[3].across)] == [-89.99, 89.99]


def test_a_frame_has_at_most_32_beams() -> None:
    (frame,) = send(*beams(MAX_BEAMS + 3), status())
    assert frame[7] == MAX_BEAMS and len(frame) == 26 + 10 * MAX_BEAMS
    assert len(make_decoder(Options()).feed(frame, 1)) == MAX_BEAMS + 1
