"""NovAtel OEM6 compared with two independent decoders: the maker's novatel_edie, and rtklib."""

from __future__ import annotations

import math
import shutil
import subprocess
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
from novatel_edie import ENCODE_FORMAT, NovatelEdieException, oem

from fti.drivers import novatel_oem6 as novatel
from fti.drivers.novatel_oem6.messages import name_of
from fti.drivers.novatel_oem6.status import BITS
from fti.geodesy.formulas import SEMI_MAJOR
from fti.messages.measurements import (
    DeviceTime,
    Measurement,
    Position,
    Pseudorange,
    Pseudoranges,
    ReceiverClock,
    Satellites,
)
from tests.helpers import ROOT
from tests.hil.test_sensors import START_NS, sensor

M = TypeVar("M")
CAPTURE = ROOT / "tests/captures/novatel_oemv_part1.gps"
MAKER = ROOT / "tests/captures/novatel_maker.asc"
LETTERS = {"gps": "G", "glonass": "R", "sbas": "S", "galileo": "E", "beidou": "C", "qzss": "J", "navic": "I"}
WEEK_S = 604_800
Epoch = dict[str, dict[str, float]]  # satellite -> observation code -> value


def decode(data: bytes) -> list[Measurement]:
    return novatel.make_decoder(novatel.Options()).feed(data, 1)


def of(measurements: list[Measurement], kind: type[M]) -> list[M]:
    return [m for m in measurements if isinstance(m, kind)]


# ----------------------------------------------------------------------------------------------- the maker's package


def edie_frames(data: bytes) -> Iterator[tuple[bytes, Any]]:
    """Frames that the maker's framer finds."""
    framer = oem.Framer()
    for at in range(0, len(data), 4096):
        framer.write(data[at : at + 4096])
        while True:
            try:
                yield framer.get_frame()
            except NovatelEdieException:
                break


def edie_binary(data: bytes) -> list[tuple[int, bytes]]:
    """Message number and bytes of the binary frames among them."""
    frames = [frame for frame, meta in edie_frames(data) if meta.format.name == "BINARY"]
    return [(int.from_bytes(frame[4:6], "little"), frame) for frame in frames]


def to_binary(line: bytes) -> bytes:
    """An ASCII message in binary form, by the maker's package."""
    return bytes(oem.Decoder().decode(line).encode(ENCODE_FORMAT.BINARY).message)


@cache
def maker_lines() -> tuple[bytes, ...]:
    return tuple(MAKER.read_bytes().splitlines(keepends=True))


def test_the_same_frames_are_found_as_by_the_makers_framer() -> None:
    decoder = novatel.make_decoder(novatel.Options())
    decoder.feed(CAPTURE.read_bytes(), 1)
    theirs = Counter(name_of(number) for number, _ in edie_binary(CAPTURE.read_bytes()))
    ours = decoder.counters.messages
    assert theirs == {"RAWWAASFRAME": 32, "TRACKSTAT": 20, "BESTPOS": 20, "SATVIS": 19, "RANGECMP": 17,
                      "RAWEPHEM": 9, "GLOEPHEMERIS": 5}  # fmt: skip
    assert {name: ours[name] for name in theirs} == theirs
    assert ours["response"] == 5
    assert decoder.counters.skipped == {"prompt": 5 * len("[USB1]"), "no_sync": 10}  # and line ends around the answers


def test_ascii_messages_are_framed_and_counted_as_by_the_makers_framer() -> None:
    decoder = novatel.make_decoder(novatel.Options())
    decoder.feed(MAKER.read_bytes(), 1)
    theirs = Counter(frame[1 : frame.index(b",")].decode() for frame, _ in edie_frames(MAKER.read_bytes()))
    assert decoder.counters.messages == theirs
    assert decoder.counters.framed == len(MAKER.read_bytes())


def test_positions_of_the_capture_are_those_that_the_package_reads() -> None:
    theirs = [oem.Decoder().decode(frame) for number, frame in edie_binary(CAPTURE.read_bytes()) if number == 42]
    ours = of(decode(CAPTURE.read_bytes()), Position)
    assert len(ours) == len(theirs) == 20
    for mine, read in zip(ours, theirs, strict=True):
        assert mine.lat == pytest.approx(math.radians(read.latitude), abs=1e-15)
        assert mine.lon == pytest.approx(math.radians(read.longitude), abs=1e-15)
        assert mine.alt == pytest.approx(read.orthometric_height + read.undulation, abs=1e-9)
        assert mine.valid == (read.solution_status.name == "SOL_COMPUTED" and read.position_type.name != "NONE")


@pytest.mark.parametrize("week", [b",2180,", b",2167,"])
def test_range_says_what_the_receiver_printed(week: bytes) -> None:
    """115 signals of five systems, and three of a receiver that does not know the time well yet."""
    line = next(x for x in maker_lines() if x.startswith(b"#RANGEA") and week in x)
    fields = line.partition(b";")[2].partition(b"*")[0].decode().split(",")[1:]
    printed = [fields[at : at + 10] for at in range(0, len(fields), 10)]
    (found,) = of(decode(to_binary(line)), Pseudoranges)
    assert (found.stamp.t_dev_ns is None) == (b"COARSE" in line)
    assert len(found.observations) == len(printed)
    for mine, (number, channel, psr, psr_sd, adr, adr_sd, doppler, cn0, lock, _) in zip(
        found.observations, printed, strict=True
    ):
        assert mine.number == int(number) - {"glonass": 37, "qzss": 192}.get(mine.system, 0)
        close(mine.pseudorange, float(psr), 5e-4)
        close(mine.pseudorange_sd, float(psr_sd), 5e-4)
        close(mine.carrier_phase, -float(adr), 5e-7)
        close(mine.carrier_phase_sd, float(adr_sd), 5e-4)
        close(mine.doppler, float(doppler), 6e-4)
        close(mine.cn0_dbhz, float(cn0), 0.06)
        close(mine.lock_time, float(lock), 2e-3)
        if mine.system == "glonass" and mine.signal == "L1C":
            assert mine.carrier_hz == 1602e6 + 562.5e3 * (int(channel) - 7)


def close(measurements: float | None, printed: float, tolerance: float) -> None:
    """Nothing is there where the receiver printed a value that was not locked."""
    assert measurements is None or measurements == pytest.approx(printed, abs=tolerance)


def test_a_compressed_range_is_what_the_maker_expands_it_to() -> None:
    """All systems; the phase has been counted on over its modulus of 2^23 cycles."""
    packed, expanded = (to_binary(next(x for x in maker_lines() if x.startswith(head) and b"407907" in x))
                        for head in (b"#RANGECMPA", b"#RANGEA"))  # fmt: skip
    (mine,), (theirs,) = of(decode(packed), Pseudoranges), of(decode(expanded), Pseudoranges)
    assert len(mine.observations) == len(theirs.observations) == 71
    for a, b in zip(mine.observations, theirs.observations, strict=True):
        assert (a.system, a.number, a.signal) == (b.system, b.number, b.signal)
        for name, tolerance in (("pseudorange", 1e-3), ("pseudorange_sd", 1e-3), ("carrier_phase", 1e-6),
                                ("carrier_phase_sd", 1e-3), ("doppler", 1e-3), ("lock_time", 1e-3),
                                ("cn0_dbhz", 1e-6)):  # fmt: skip
            assert getattr(a, name) == pytest.approx(getattr(b, name), abs=tolerance), name


def test_clock_time_and_position_say_what_the_receiver_printed() -> None:
    measurements = [m for line in maker_lines() if b"RANGE" not in line for m in decode(to_binary(line))]
    unknown, coarse, fine = of(measurements, DeviceTime)
    assert unknown.stamp.t_dev_ns is coarse.stamp.t_dev_ns is None
    assert fine.stamp.t_dev_ns == (2180 * WEEK_S + 407_600) * 1_000_000_000
    model = next(c for c in of(measurements, ReceiverClock) if c.drift is not None)
    assert model.offset == pytest.approx(-0.8630928664 / 299_792_458.0)
    assert model.drift == pytest.approx(0.01883231757 / 299_792_458.0)
    assert [c.valid for c in of(measurements, ReceiverClock)] == [False, False, False, True]  # ITERATING is not valid
    (position,) = of(measurements, Position)
    assert position.alt is not None
    assert position.alt_msl is not None
    assert position.alt - position.alt_msl == pytest.approx(-16.9, abs=1e-5)


def test_names_of_the_status_bits_are_those_of_the_package() -> None:
    """Bit by bit; 8 to 10, 15 and 17 mean something else in an OEM7."""
    theirs = {
        "error": "reciever_error", "temperature": "temperature_warning", "supply_voltage": "voltage_warning",
        "antenna_unpowered": "antenna_powered", "lna_failure": "lna_failure", "antenna_open": "antenna_open_circuit",
        "antenna_shorted": "antenna_short_circuit", "cpu_overload": "cpu_overload", "link_overrun": "link_overrun",
        "almanac_invalid": "gps_almanac_invalid", "position_invalid": "position_solution_invalid",
        "position_fixed": "position_fixed", "clock_steering_off": "clock_steering_disabled",
        "clock_model_invalid": "clock_model_invalid", "oscillator_locked": "external_oscillator_locked",
        "software_resource": "software_resource_warning", "hdr_tracking": "tracking_mode_hdr",
        "digital_filtering": "digital_filtering_enabled", "aux1_event": "auxiliary_1_event",
        "aux2_event": "auxiliary_2_event", "aux3_event": "auxiliary_3_event",
    }  # fmt: skip
    for ours, name in theirs.items():
        assert getattr(oem.RecieverStatus(1 << BITS[1].index(ours)), name) is True, ours


# ------------------------------------------------------------------------------------------------------------ rtklib


def rtklib(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        pytest.skip(f"{name} (Debian: rtklib) is not installed")
    return found


def rinex(data: bytes, folder: Path) -> dict[float, Epoch]:
    """What rtklib's convbin makes of the bytes: GPS seconds -> satellite -> observation code -> value."""
    raw, obs, nav = folder / "raw.gps", folder / "raw.obs", folder / "raw.nav"
    raw.write_bytes(data)
    command = [rtklib("convbin"), "-r", "nov", "-v", "3.04", "-od", "-os", "-o", str(obs), "-n", str(nav), str(raw)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return read_rinex(obs.read_text())


def read_rinex(text: str) -> dict[float, Epoch]:
    head, _, body = text.partition("END OF HEADER")
    codes: dict[str, list[str]] = {}
    for line in head.splitlines():
        if "SYS / # / OBS TYPES" in line:
            system = line[0].strip() or list(codes)[-1]  # a second line goes on
            codes.setdefault(system, []).extend(line[6:60].split())
    epochs: dict[float, Epoch] = {}
    for line in body.splitlines()[1:]:
        if line.startswith(">"):
            epoch = epochs.setdefault(epoch_seconds(line.split()[1:7]), {})
            continue
        cells = {code: line[3 + 16 * i : 17 + 16 * i].strip() for i, code in enumerate(codes[line[0]])}
        epoch[line[:3].replace(" ", "0")] = {code: float(cell) for code, cell in cells.items() if cell}
    return epochs


def epoch_seconds(fields: list[str]) -> float:
    day = np.datetime64("-".join(f"{int(x):02d}" for x in fields[:3]))
    days = (day - np.datetime64("1980-01-06")).astype(int)
    return float(days * 86400 + int(fields[3]) * 3600 + int(fields[4]) * 60) + float(fields[5])


def satellite(o: Pseudorange) -> str:
    return f"{LETTERS[o.system]}{o.number - 100 if o.system == 'sbas' else o.number:02d}"


def ours_as_rinex(data: bytes) -> dict[float, Epoch]:
    epochs: dict[float, Epoch] = {}
    for epoch in of(decode(data), Pseudoranges):
        assert epoch.stamp.t_dev_ns is not None
        measurements = epochs.setdefault(epoch.stamp.t_dev_ns / 1e9, {})
        for o in epoch.observations:
            values = {"C": o.pseudorange, "L": o.carrier_phase, "D": o.doppler, "S": o.cn0_dbhz}
            for kind, value in values.items():
                if value is not None:
                    measurements.setdefault(satellite(o), {})[kind + o.signal[1:]] = value
    return epochs


TOLERANCE = {"C": 6e-4, "L": 6e-4, "D": 6e-4, "S": 0.06}  # half of the last digit that is written, and a little


def assert_same(theirs: dict[float, Epoch], ours: dict[float, Epoch]) -> int:
    """Every value that rtklib writes is ours; how many there are."""
    count = 0
    assert theirs.keys() == ours.keys()
    for time, epoch in theirs.items():
        for name, values in epoch.items():
            for code, value in values.items():
                mine = ours[time][name][code]
                assert mine == pytest.approx(value, abs=TOLERANCE[code[0]]), (time, name, code)
                count += 1
    return count


def test_observations_of_the_capture_are_those_of_rtklib(tmp_path: Path) -> None:
    """GPS, GLONASS and SBAS on two frequencies, from RANGECMP: 17 epochs of 16 satellites."""
    theirs, ours = rinex(CAPTURE.read_bytes(), tmp_path), ours_as_rinex(CAPTURE.read_bytes())
    assert assert_same(theirs, ours) == sum(len(v) for epoch in ours.values() for v in epoch.values()) == 2040
    assert {name[0] for epoch in ours.values() for name in epoch} == {"G", "R", "S"}


def test_observations_of_a_modern_receiver_are_those_of_rtklib(tmp_path: Path) -> None:
    """RANGE with 115 signals; of those on one frequency rtklib keeps one."""
    data = to_binary(next(x for x in maker_lines() if x.startswith(b"#RANGEA") and b",2167," in x))
    theirs, ours = rinex(data, tmp_path), ours_as_rinex(data)
    assert assert_same(theirs, ours) > 300
    assert {name[0] for epoch in theirs.values() for name in epoch} >= {"G", "R", "E", "C"}


def test_what_the_emulated_receiver_measures_rtklib_reads(tmp_path: Path) -> None:
    result = sensor("novatel_oem6")
    encoder = novatel.make_encoder(novatel.Options(unasked=True))
    data = b"".join(f for k in range(0, 30, 10) for m in result.measure(k, START_NS) for f in encoder.encode(m))
    ours = {round(t, 7): epoch for t, epoch in ours_as_rinex(data).items()}
    theirs = {round(t, 7): epoch for t, epoch in rinex(data, tmp_path).items()}
    count = assert_same(theirs, ours)
    assert count == sum(len(v) for epoch in ours.values() for v in epoch.values()) > 300


def solve(folder: Path, mask_deg: int) -> list[list[str]]:
    """The capture, solved by rtklib's own single-point solution: its positions, and lines of its status."""
    rinex(CAPTURE.read_bytes(), folder)
    files = [str(folder / name) for name in ("raw.obs", "raw.nav")]
    out = folder / "sol.pos"
    command = [rtklib("rnx2rtkp"), "-p", "0", "-m", str(mask_deg), "-y", "2", "-o", str(out), *files]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return rows(out) + rows(folder / "sol.pos.stat")


def rows(path: Path) -> list[list[str]]:
    return [line.replace(",", " ").split() for line in path.read_text().splitlines() if not line.startswith("%")]


def test_fixes_of_the_capture_are_where_rtklib_puts_them(tmp_path: Path) -> None:
    """Two single-point solutions, one smoothed: within metres; the geoid there is 40 m above the ellipsoid."""
    theirs = {round(float(r[1])): [float(x) for x in r[2:5]] for r in solve(tmp_path, 15) if not r[0].startswith("$")}
    valid = [p for p in of(decode(CAPTURE.read_bytes()), Position) if p.valid]
    assert len(valid) == 17
    compared = 0
    for p in valid:
        assert p.stamp.t_dev_ns is not None
        there = theirs.get(round(p.stamp.t_dev_ns / 1e9) % WEEK_S)
        if there is None or p.lat is None or p.lon is None or p.alt is None:
            continue
        north = (p.lat - math.radians(there[0])) * SEMI_MAJOR
        east = (p.lon - math.radians(there[1])) * SEMI_MAJOR * math.cos(p.lat)
        assert math.hypot(north, east) < 5.0
        assert abs(p.alt - there[2]) < 8.0
        compared += 1
    assert compared >= 15


def test_directions_of_the_satellites_are_those_of_rtklib(tmp_path: Path) -> None:
    """Ours are the receiver's, from almanacs; theirs from ephemerides: within a degree."""
    theirs = {r[3]: (math.radians(float(r[5])), math.radians(float(r[6]))) for r in solve(tmp_path, 5)
              if r[0] == "$SAT" and float(r[6]) > 0.0}  # fmt: skip
    ours = {f"{LETTERS[s.system]}{s.number:02d}": s for sky in of(decode(CAPTURE.read_bytes()), Satellites)
            for s in sky.satellites if s.system in ("gps", "glonass")}  # fmt: skip
    both = theirs.keys() & ours.keys()
    assert len(both) >= 12
    for name in both:
        mine, (azimuth, elevation) = ours[name], theirs[name]
        assert mine.azimuth is not None
        assert mine.elevation is not None
        assert abs(math.remainder(mine.azimuth - azimuth, math.tau)) * math.cos(elevation) < math.radians(1.0)
        assert abs(mine.elevation - elevation) < math.radians(1.0)
