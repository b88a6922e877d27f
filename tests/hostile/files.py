"""Hostile files other than sessions: configurations, scenarios, DBC, label sets, captures, elevation, references."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

from tests.hostile.damage import CONFIGS, DEEP, DIGITS, MORE_DIGITS

ROOT = Path(__file__).resolve().parents[2]
AIRFIELD = """
name = "x"
threshold_lat_deg = 47.9
threshold_lon_deg = 11.8
threshold_alt_m = 600.0
course_deg = 90.0
runway_length_m = 1000.0
survey_date = "2020-01-01"
"""
DBC = """VERSION ""
BU_: ECU
BO_ 100 Air: 8 ECU
 SG_ speed : 0|16@1+ (0.1,0) [0|500] "m/s" ECU
 SG_ mode M : 16|8@1+ (1,0) [0|255] "" ECU
 SG_ first m0 : 24|8@1+ (1,0) [0|255] "" ECU
"""
SCENARIO = """
title = "t"
description = ""
config = "{config}"
seed = 1
[flight]
kind = "approach"
duration_s = 20
"""
LABELS = '[ahrs]\nequipment = "005"\n[[ahrs.labels]]\nlabel = "324"\nname = "pitch"\n'

Change = Callable[[bytes, random.Random], bytes]


def _as(data: bytes | str) -> Change:
    made = data.encode() if isinstance(data, str) else data
    return lambda good, rng: made


def _replaced(old: str, new: str) -> Change:
    return lambda good, rng: good.replace(old.encode(), new.encode())


def _flips(good: bytes, rng: random.Random) -> bytes:
    data = bytearray(good)
    for _ in range(rng.choice([1, 3, 20])):
        data[rng.randrange(min(len(data), rng.choice([200, 10**9])))] ^= 1 << rng.randrange(8)
    return bytes(data)


def _cut(good: bytes, rng: random.Random) -> bytes:
    return good[: rng.randrange(len(good))]


def _garbage(good: bytes, rng: random.Random) -> bytes:
    return good[: rng.choice([0, 4, 40])] + rng.randbytes(rng.randrange(2000))


def _digits(good: bytes, rng: random.Random) -> bytes:
    """A number becomes very long."""
    places = [k for k, byte in enumerate(good) if chr(byte).isdigit()]
    at = rng.choice(places)
    return good[:at] + rng.choice([DIGITS, MORE_DIGITS, b"9" * 25]) + good[at + 1 :]


def _bytes_ff(good: bytes, rng: random.Random) -> bytes:
    """A field of a binary file has the largest or the smallest value."""
    at, size = rng.randrange(min(len(good), 600)), rng.choice([2, 4, 8])
    return good[:at] + rng.choice([b"\xff", b"\x7f", b"\0"]) * size + good[at + size :]


ANY: dict[str, Change] = {
    **{f"{change.__name__.strip('_')} {k}": change for change in (_flips, _cut, _garbage) for k in range(4)},
    "empty": _as(b""),
    "NULs": _as(bytes(3000)),
    "not UTF-8": _as(b"\xff\xfe\xfd"),
    "surrogates": _as(b"\xed\xa0\x80" * 10),
}
TEXTS: dict[str, Change] = {f"digits {k}": _digits for k in range(4)}
TOMLS: dict[str, Change] = {name: _as(data) for name, data in CONFIGS.items()}
DBCS: dict[str, Change] = {
    "float of 24 bits": lambda good, rng: good.replace(b"0|16@1+", b"0|24@1-") + b"SIG_VALTYPE_ 100 speed : 1;\n",
    "float of 16 bits as double": lambda good, rng: good + b"SIG_VALTYPE_ 100 speed : 2;\n",
    "multiplexer loop": _as(
        DBC.replace("mode M", "mode m1M").replace("first m0", "first m0M")
        + "SG_MUL_VAL_ 100 mode first 1-1;\nSG_MUL_VAL_ 100 first mode 0-0;\n"
    ),
    "multiplexer itself": _as(DBC.replace("mode M", "mode m1M") + "SG_MUL_VAL_ 100 mode mode 1-1;\n"),
    "multiplexer of nobody": _as(DBC + "SG_MUL_VAL_ 100 first stranger 1-1;\n"),
    "multiplexer range": _as(DBC.replace("first m0", "first m0") + "SG_MUL_VAL_ 100 first mode 0-4000000000;\n"),
    "without bits": _replaced("0|16@1+", "0|0@1+"),
    "long message": _replaced("Air: 8", "Air: 2000000000"),
    "long signal": _replaced("0|16@1+", "0|2000000000@1+"),
    "far signal": _replaced("0|16@1+", "4000000000|16@1+"),
    "factor 0": _replaced("(0.1,0)", "(0,0)"),
    "factor inf": _replaced("(0.1,0)", "(1e999,0)"),
    "factor nan": _replaced("(0.1,0)", "(nan,0)"),
    "large identifier": _replaced("BO_ 100", "BO_ 99999999999999"),
    "same name": lambda good, rng: good + b'BO_ 101 Air: 8 ECU\n SG_ speed : 0|16@1+ (1,0) [0|0] "" ECU\n',
    "no sender": _replaced("8 ECU", "8"),
    "deep": _as("VERSION " + "(" * DEEP),
    "value table": lambda good, rng: good + b"VAL_ 100 speed " + DIGITS + b' "x" ;\n',
    "cycle time": lambda good, rng: (
        good
        + b'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 1000000;\nBA_DEF_DEF_ "GenMsgCycleTime" 0;\n'
        + b'BA_ "GenMsgCycleTime" BO_ 100 -5;\n'
    ),
    "cycle text": lambda good, rng: (
        good
        + b'BA_DEF_ BO_ "GenMsgCycleTime" STRING ;\nBA_DEF_DEF_ "GenMsgCycleTime" "";\n'
        + b'BA_ "GenMsgCycleTime" BO_ 100 "x";\n'
    ),
}
CAPTURES: dict[str, Change] = {
    "candump time": _as(b"(" + b"9" * 60 + b".0) can0 064#00\n"),
    "candump digits": _as(b"(" + MORE_DIGITS + b".0) can0 064#00\n"),
    "candump identifier": _as(b"(1.0) can0 " + b"F" * 3000 + b"#00\n"),
    "candump data": _as(b"(1.0) can0 064#" + b"00" * 4000 + b"\n"),
    "candump fraction": _as(b"(1." + b"9" * 3000 + b") can0 064#00\n"),
    "candump superscript": _as("(1.0) can0 064##²\n".encode()),
    "long line": _as(b"$GNGGA," + b"1" * 300_000),
}
REFERENCES: dict[str, Change] = {
    "deep key": _replaced("# sensor.", "# " + "a." * 20_000),
    "key of a value": _replaced("# airfield.name = ", "# airfield = 1\n# airfield.name = "),
    "step": lambda good, rng: _line(good, b"# profile.ds_m", b"# profile.ds_m = 1e-12"),
    "length": lambda good, rng: _line(good, b"# profile.s_max_m", b"# profile.s_max_m = 1e300"),
    "infinite": lambda good, rng: _line(good, b"# profile.s_max_m", b"# profile.s_max_m = inf"),
    "not a number": lambda good, rng: _line(good, b"# profile.ds_m", b"# profile.ds_m = nan"),
    "step 0": lambda good, rng: _line(good, b"# profile.ds_m", b"# profile.ds_m = 0"),
    "nested value": lambda good, rng: _line(good, b"# profile.ds_m", b"# profile.ds_m = " + b"[" * 5000),
}


def _line(good: bytes, begin: bytes, instead: bytes) -> bytes:
    return b"\n".join(instead if line.startswith(begin) else line for line in good.split(b"\n"))


FILE_DAMAGES: dict[str, dict[str, Change]] = {
    "config": {**ANY, **TEXTS, **TOMLS},
    "scenario": {**ANY, **TEXTS, **TOMLS},
    "dbc": {**ANY, **TEXTS, **DBCS},
    "labels": {**ANY, **TEXTS, **TOMLS},
    "capture": {**ANY, **CAPTURES},
    "elevation": {
        **ANY,
        **{f"field {k}": _bytes_ff for k in range(8)},
        **{f"more flips {k}": _flips for k in range(6)},
    },
    "reference": {**ANY, **TEXTS, **REFERENCES},
    "airfield": {**ANY, **TEXTS, **TOMLS},
}


def good_file(kind: str, place: Path) -> bytes:
    """The file before the damage."""
    if kind == "elevation":
        import numpy as np

        from tests.terrain.elevation_files import from_origin, write_tif

        heights = 600.0 + np.add.outer(np.arange(40.0), np.arange(50.0))
        path = write_tif(place / "good.tif", heights, "EPSG:4326", from_origin(11.8, 47.9, 0.001, 0.001))
        return Path(path).read_bytes()
    texts = {
        "config": (ROOT / "configs/demo.toml").read_bytes,
        "scenario": lambda: SCENARIO.format(config=ROOT / "configs/demo.toml").encode(),
        "dbc": DBC.encode,
        "labels": LABELS.encode,
        "capture": lambda: b"$GNGGA,030405.00,4754.0,N,01148.0,E,1,10,0.9,600.0,M,47.0,M,,*5A\r\n" * 20,
        "reference": (ROOT / "configs/profiles/demo.csv").read_bytes,
        "airfield": AIRFIELD.encode,
    }
    return texts[kind]()


def write_file(kind: str, name: str, rng: random.Random, place: Path) -> Path:
    """A damaged file of a kind."""
    (place / "capture.log").write_text("(1.0) can0 064#0102030405060708\n" * 3)
    file = place / f"hostile.{'tif' if kind == 'elevation' else 'toml'}"
    file.write_bytes(FILE_DAMAGES[kind][name](good_file(kind, place), rng))
    return file
