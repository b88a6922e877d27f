"""``fti drivers`` and ``fti decode``: what they print, and what they say when something is wrong."""

from __future__ import annotations

import errno
import io
import json
import sys
from pathlib import Path

import pytest

from fti import drivers
from fti.canframe import pack_can, unpack_can
from fti.cli.decode import candump_frames, open_capture, reads
from fti.cli.main import main
from tests.helpers import ROOT

CAPTURE = str(ROOT / "tests/captures/nmea-rtk.log")
VESSEL = str(ROOT / "tests/captures/nmea2000_part1.candump.log")
WORDS = str(ROOT / "tests/drivers/vectors/arinc429_ahrs.bin")
MAKERS_DBC = str(ROOT / "configs/dbc/air_data_unit.dbc")


def run(capsys: pytest.CaptureFixture[str], *args: str) -> tuple[int, list[str], list[str]]:
    code = main(list(args))
    out, err = capsys.readouterr()
    return code, out.splitlines(), err.splitlines()


def test_the_list_has_one_driver_per_line_name_first(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "drivers")
    assert code == 0
    assert tuple(line.split()[0] for line in out) == drivers.names()


def test_a_driver_is_described(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "drivers", "arinc429")
    text = "\n".join(out)
    assert code == 0
    assert "on serial, udp" in text
    assert 'byte_order = "big"   (one of big, little)' in text
    assert "radio_height" in text
    _, out, _ = run(capsys, "drivers", "nmea0183")
    assert '  checksum = "required"   (one of required, optional)' in out
    _, out, _ = run(capsys, "drivers", "lightware_ascii")
    assert "    period of the requests [s]" in out


def test_descriptions_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "drivers", "--json")
    every = json.loads("\n".join(out))
    assert [d["name"] for d in every] == list(drivers.names())
    assert all(d["document"] and d["messages"] and d["carriers"] for d in every)
    _, out, _ = run(capsys, "drivers", "mavlink", "--json")
    height = json.loads("\n".join(out))["options"]["height"]
    assert (height["default"], height["limits"]) == ('"msl"', "one of msl, ellipsoid")


@pytest.mark.parametrize("chunk", ["1", "7", "4096"])
def test_a_capture_becomes_json_lines_and_a_count(capsys: pytest.CaptureFixture[str], chunk: str) -> None:
    code, out, err = run(capsys, "decode", CAPTURE, "--driver", "nmea0183", "--chunk", chunk, "--json")
    assert (code, err) == (0, [])
    *lines, last = [json.loads(line) for line in out]
    assert last["counters"]["messages"] == {"GGA": 122, "RMC": 122}
    assert last["counters"]["bytes_in"] == Path(CAPTURE).stat().st_size
    assert len(lines) == 122 * 3 + 122 * 2
    assert lines[0]["measurement"] == "Position"
    assert lines[0]["values"]["alt_msl"] == 278.161
    assert lines[0]["values"]["stamp"]["time_scale"] is None


def test_without_json_the_count_goes_to_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "decode", CAPTURE, "--driver", "nmea0183")
    assert code == 0
    assert all(json.loads(line)["values"] for line in out)
    assert "  GGA 122" in err
    assert "bytes 22370: framed 22083, held 0, skipped 287" in err
    assert "  comment 287" in err


def test_options_reach_the_driver(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "decode", WORDS, "--driver", "arinc429", "--option", "set=ahrs", "--json")
    assert [json.loads(line).get("measurement") for line in out][:2] == ["Position", "Position"]
    _, out, _ = run(capsys, "decode", WORDS, "--driver", "arinc429", "--option", "label_reversed=false", "--json")
    assert json.loads(out[-1])["counters"]["framed"] == 0


def test_a_can_log_is_read_frame_by_frame(capsys: pytest.CaptureFixture[str]) -> None:
    for driver, *options in (["canaerospace"], ["dbc", "--option", f"dbc_file={MAKERS_DBC}"]):
        code, out, _ = run(capsys, "decode", VESSEL, "--driver", driver, "--json", *options)
        assert code == 0
        assert json.loads(out[-1])["counters"]["skipped"] == {"other_id": 64_000}


def test_what_never_came_is_counted_where_messages_are_numbered(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    log = tmp_path / "can.log"
    codes = ("00", "01", "05")
    log.write_text("".join(f"({n}.0) can0 146#010200{code}447D5000\n" for n, code in enumerate(codes)))
    _, out, err = run(capsys, "decode", str(log), "--driver", "canaerospace")
    assert err[-2:] == ["lost", "  static_pressure 3"]
    assert any("static_pressure_lost_3" in line for line in out)
    _, out, _ = run(capsys, "decode", str(log), "--driver", "canaerospace", "--json")
    assert json.loads(out[-1])["counters"]["lost"] == {"static_pressure": 3}


def test_can_frames_in_binary(capsys: pytest.CaptureFixture[str]) -> None:
    file = str(ROOT / "tests/drivers/vectors/canaerospace_libcanaerospace.bin")
    _, out, _ = run(capsys, "decode", file, "--driver", "canaerospace", "--json")
    assert json.loads(out[-1])["counters"]["messages"]["static_pressure"] == 2


def test_lines_of_candump_are_frames() -> None:
    first = "(1410714882.622188) can0 09F80102#36729A16021AB80D\n\n"
    text = first + "(1.5) can0 123#\n(1.5) can0 123#R\n(1.5) vcan0 12345678##1AA"
    result = list(candump_frames(text.splitlines(), Path("x.log")))
    assert result[0][0] == 1_410_714_882_622_188_000
    frames = [unpack_can(data) for _, data in result]
    assert (frames[0].can_id, frames[0].extended, frames[0].data.hex()) == (0x09F80102, True, "36729a16021ab80d")
    assert (frames[1].can_id, frames[1].extended, frames[1].data) == (0x123, False, b"")
    assert frames[2].remote
    assert (frames[3].fd, frames[3].data) == (True, b"\xaa")


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (("decode", CAPTURE, "--driver", "canaerospace"), "is text but not a candump -L log: '# "),
        (("drivers", "nmea"), "no driver 'nmea'; drivers: arinc429"),
        (("decode", CAPTURE, "--driver", "nmea"), "no driver 'nmea'; drivers: arinc429"),
        (("decode", "no_such_file", "--driver", "nmea0183"), "no_such_file: cannot be read: No such file"),
        (("decode", CAPTURE, "--driver", "nmea0183", "--chunk", "0"), "--chunk = 0: must be 1 or more"),
        (("decode", CAPTURE, "--driver", "nmea0183", "--option", "x"), "--option = 'x': must be KEY=VALUE"),
        (("decode", CAPTURE, "--driver", "nmea0183", "--option", "x=1"), "--option: x: there is no such key"),
        (("decode", WORDS, "--driver", "arinc429", "--option", "set=none"), "--option: labels: none enabled"),
        (("decode", VESSEL, "--driver", "canaerospace", "--option", "dbc_file=gone.dbc"), "gone.dbc: cannot be read"),
        (("decode", VESSEL, "--driver", "canaerospace", "--option", f"dbc_file={WORDS}"), "is not UTF-8 text"),
        (
            ("decode", VESSEL, "--driver", "canaerospace", "--option", f"dbc_file={CAPTURE}"),
            "--option: dbc: Invalid syntax at line 1",
        ),
    ],
)
def test_what_is_wrong_is_one_sentence(
    capsys: pytest.CaptureFixture[str], args: tuple[str, ...], sentence: str
) -> None:
    code, out, err = run(capsys, *args)
    assert code == 2
    assert out == []
    assert sentence in " ".join(err)


def test_a_damaged_can_log_names_the_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = tmp_path / "can.log"
    log.write_text("(1.0) can0 123#00\n(1.0) can0 123\n")
    code, _, err = run(capsys, "decode", str(log), "--driver", "canaerospace")
    assert code == 2
    assert "line 2: is not a candump line" in err[0]


def test_a_can_log_may_begin_with_comments(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = tmp_path / "can.log"
    log.write_text("# flight 7\n\n# bus 1\n(1.5) can0 146#01020000447D5000\n")
    code, out, _ = run(capsys, "decode", str(log), "--driver", "canaerospace", "--json")
    assert code == 0
    assert json.loads(out[-1])["counters"]["messages"] == {"static_pressure": 1}
    assert json.loads(out[0])["values"]["stamp"]["t_rx_ns"] == 1_500_000_000


@pytest.mark.parametrize("can_id", [0x28, 0x128, 0x123])
def test_binary_frames_whose_identifier_looks_like_text_are_binary(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, can_id: int
) -> None:
    """0x28 is "(", and 0x23 is "#"."""
    file = tmp_path / "frames.bin"
    file.write_bytes(pack_can(can_id, b"\1") + pack_can(0x146, bytes.fromhex("01020000447D5000")))
    code, out, _ = run(capsys, "decode", str(file), "--driver", "canaerospace", "--json")
    assert code == 0
    assert json.loads(out[-1])["counters"]["messages"] == {"static_pressure": 1}


def test_a_capture_is_read_piece_by_piece(tmp_path: Path) -> None:
    """One that is larger than the memory is decoded, too: here 64 GB that take no room on the medium."""
    file = tmp_path / "large.bin"
    with file.open("wb") as large:
        large.truncate(1 << 36)
    with open_capture(file) as capture:
        assert next(reads(drivers.load("nmea0183"), capture, 4096)) == (0, bytes(4096))


def test_an_option_that_is_text_may_look_like_a_number(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--option", "sync=5959", "--option", "length=4", "--option", 'fields=[{name="x", at=2, type="u16"}]')
    code, out, _ = run(capsys, "decode", CAPTURE, "--driver", "binary_struct", "--json", *options)
    assert code == 0
    assert json.loads(out[-1])["counters"]["framed"] == 0


class Full(io.StringIO):
    """A medium without room."""

    def write(self, text: str) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_an_output_that_is_full_is_one_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdout", Full())
    code, _, err = run(capsys, "decode", CAPTURE, "--driver", "nmea0183")
    assert (code, err) == (2, [f"fti: {CAPTURE}: decoding stopped: No space left on device"])
