"""FreeFlight RA-4500: quantisation, traps of its framing, the open details as options."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.drivers import freeflight_ra4500 as ra
from fti.messages.measurements import DeviceStatus, RadioHeight, Stamp
from fti.ranging.radar.quantise import quantisation_step_ft, quantise_ft

FOOT = 0.3048
S = Stamp(0)


def heights(data: bytes, options: ra.Options | None = None) -> list[RadioHeight]:
    measurements = ra.make_decoder(options or ra.Options()).feed(data, 1)
    return [m for m in measurements if isinstance(m, RadioHeight)]


def frame(altitude: int, status: int = 0x10) -> bytes:
    return b"\x10\xdf\x03" + altitude.to_bytes(2, "big") + bytes([status, 0]) + b"\x10\x03"


@pytest.mark.parametrize(
    ("height", "step"),
    [
        (0, 1),
        (119, 1),
        (120, 2),
        (199, 2),
        (200, 5),
        (499, 5),
        (500, 20),
        (999, 20),
        (1000, 50),
        (2099, 50),
        (2100, 100),
    ],
)
def test_quantisation_is_the_corrected_table(height: int, step: int) -> None:
    assert quantisation_step_ft(height) == step
    assert quantise_ft(height) % step == 0


def test_sigma_is_that_of_the_step() -> None:
    (found,) = heights(frame(2400))
    assert found.sd == pytest.approx(100 * FOOT / 12**0.5, abs=1e-9)


def test_the_instruments_own_accuracy_is_added_as_variance() -> None:
    """1000 ft: a step of 50 ft is 14.434 ft, and 1 ft and 2 % (20 ft) with it sqrt(208.33 + 1 + 400) = 24.685 ft."""
    (found,) = heights(frame(1000), ra.Options(sd_ft=1.0, sd_percent=2.0))
    assert found.sd == pytest.approx(24.685 * 0.3048, abs=1e-3)
    with pytest.raises(ValueError, match="greater than or equal to 0"):
        ra.Options(sd_ft=-1.0)


@pytest.mark.parametrize("altitude", [0x0010, 0x1003, 0x10DF, 0x1010, 0xDF03])
def test_sync_and_trailer_bytes_inside_the_data_do_no_harm(altitude: int) -> None:
    results = heights(frame(altitude) * 3)
    assert [m.height_agl for m in results] == [pytest.approx(altitude * FOOT)] * 3


@pytest.mark.parametrize(("status", "flag"), [(0x02, "self_test"), (0x04, "failure"), (0x08, "unlocked")])
def test_the_device_says_when_it_is_not_to_be_used(status: int, flag: str) -> None:
    measurements = ra.make_decoder(ra.Options()).feed(frame(500, status), 1)
    assert [m.ok if isinstance(m, DeviceStatus) else getattr(m, "valid", None) for m in measurements] == [False, False]
    assert isinstance(measurements[0], DeviceStatus)
    assert measurements[0].flags == (flag,)


@pytest.mark.parametrize(("altitude", "valid"), [(8191, True), (8192, False), (0xFFFE, False), (0xFFFF, False)])
def test_a_height_that_the_instrument_does_not_reach_is_not_valid(altitude: int, valid: bool) -> None:
    """FFFE is 20 km, or -2 ft of an aircraft that stands on its wheels."""
    assert [m.valid for m in heights(frame(altitude))] == [valid]


@pytest.mark.parametrize("rule", ["xor", "sum"])
def test_a_checksum_rule_refuses_a_changed_byte(rule: str) -> None:
    options = ra.Options(checksum=rule)  # type: ignore[arg-type]
    (good,) = ra.make_encoder(options).encode(RadioHeight(stamp=S, height_agl=100.0))
    assert len(heights(good, options)) == 1
    for at in (3, 4, 5, 6):
        bad = bytearray(good)
        bad[at] ^= 0x01
        assert heights(bytes(bad), options) == []


@given(st.lists(st.integers(0, 8000), min_size=1, max_size=5), st.sampled_from(["none", "xor", "sum"]))
def test_stuffing_takes_every_height_there_and_back(feet: list[int], rule: str) -> None:
    options = ra.Options(dle_stuffing=True, checksum=rule)  # type: ignore[arg-type]
    encoder = ra.make_encoder(options)
    data = b"".join(b for h in feet for b in encoder.encode(RadioHeight(stamp=S, height_agl=h * FOOT)))
    results = heights(data, options)
    assert [round((m.height_agl or 0.0) / FOOT) for m in results] == [quantise_ft(h * FOOT / FOOT) for h in feet]


def test_a_lone_escape_in_a_stuffed_frame_is_not_a_frame() -> None:
    decoder = ra.make_decoder(ra.Options(dle_stuffing=True))
    assert decoder.feed(frame(0x1003) + frame(0x0101, status=0), 1)[-1].stamp == Stamp(1)
    assert decoder.counters.skipped["bad_stuffing"] == 1
    assert decoder.counters.messages["height"] == 1


def test_the_encoder_states_validity_by_the_flags() -> None:
    encoder = ra.make_encoder(ra.Options())
    encoder.encode(DeviceStatus(stamp=S, ok=False, flags=("failure", "in_air")))
    (lost,) = encoder.encode(RadioHeight(stamp=S, height_agl=None, valid=False))
    assert lost[5] == 0x14
    (good,) = encoder.encode(RadioHeight(stamp=S, height_agl=10.0))
    assert good[5] == 0x10


@pytest.mark.parametrize("at", [7, 8])
def test_a_frame_without_its_trailer_is_not_accepted(at: int) -> None:
    bad = bytearray(frame(500))
    bad[at] ^= 0x01
    decoder = ra.make_decoder(ra.Options())
    measurements = decoder.feed(bytes(bad) + frame(400), 1)
    assert [m.height_agl for m in measurements if isinstance(m, RadioHeight)] == [pytest.approx(400 * FOOT)]
    assert decoder.counters.skipped["bad_trailer"] == 1


def test_halves_of_two_frames_with_the_loss_of_the_port_between_them_are_no_height() -> None:
    """0x02FF ft before, 0x0300 ft behind it: the halves together would be 0x0200 or 0x03FF ft."""
    before, following = frame(0x02FF), frame(0x0300)
    decoder = ra.make_decoder(ra.Options())
    assert decoder.feed(before[:4], 0) == []
    assert decoder.feed(following[4:], 500_000_000) == []
    assert len(decoder.feed(following[:4], 540_000_000) + decoder.feed(following[4:], 550_000_000)) == 2
    assert decoder.counters.skipped["pause"] == 4
    assert decoder.counters.bytes_in == decoder.counters.framed + decoder.counters.skipped.total()
