"""The arguments of ``fti reference make``, and the text above them."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from datetime import date
from pathlib import Path

MAKE = """Make the reference of an approach: its profile and the limits of the tests.

    fti reference make --airfield FILE --terrain dsm_1m.tif srtm.hgt --vertical egm96 --out profiles/27.csv
    fti reference make --airfield FILE --recorded SESSION SESSION --sensor radar_altimeter --out profiles/27.csv

From terrain: the elevation files must cover the approach to 250 m beyond --s-max, 1500 m to each side.  What grows on
the ground is as the files have it: seasons are in the limits only where the approaches were recorded.  The smallest
obstacle that is seen, by its width and the part of the way, is in the file, too.

The receiver is drawn: antenna pattern, beam width (10 % about the stated one), detection threshold (3 to 13 dB under
the peak) and range bias, or first and last echo and pointing of a laser.  The spread is in the profile's sigma.

The limits hold for what the file states as assumptions: sigmas of navigation, track and elevation, beam of the
altimeter.  A navigation that states more than 1.25 times as much in flight makes integrity unavailable (assumption).
Larger assumptions mean fewer alarms and later detection.

--fitted: the altimeter as fti reference fit has found it on flights, in place of the stated beam.

From recordings: 5 approaches or more from --s-max on, in one session or many, with a height every 20 m, and navigation
that did not rest on the same altimeter.  One that was broken off counts as far as it went; each place needs the heights
of 3, and its sigma is the larger, the fewer there are.  Sessions without outputs: fti reprocess first.

2000 approaches of 7 km take some minutes of a core; with a tenth of them the limits are guesses.  Then, in the
daemon's configuration, with its path from there:

    [nav.approach]
    profile = "profiles/27.csv"
    alert_v_m = 30.0        # at least the protection level that this command prints
"""


def add_make(make: argparse.ArgumentParser) -> None:
    """Its arguments."""
    make.add_argument("--airfield", required=True, type=Path, metavar="FILE", help="the airfield file (TOML)")
    source = make.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "--recorded", nargs="+", type=Path, metavar="SESSION", help="recorded flights with 5 approaches or more"
    )
    make.add_argument(
        "--sensor", default="altimeter", metavar="NAME", help="their altimeter, or that of --config (altimeter)"
    )
    source.add_argument("--terrain", nargs="+", metavar="FILE", help="elevation files below the approach, or: demo")
    make.add_argument("--vertical", choices=["egm96", "egm2008", "ellipsoid"], help="datum of files that do not say it")
    make.add_argument("--surface", metavar="NAME", help="what the ground is called (default: the files)")
    make.add_argument(
        "--date",
        type=_date,
        metavar="YYYY-MM-DD",
        help="of its survey (default: the airfield's, or the last recording's)",
    )
    make.add_argument("--out", required=True, type=Path, metavar="FILE", help="the reference to write (CSV)")
    make.add_argument(
        "--altimeter",
        choices=["ra4500", "laser"],
        help="kind of altimeter (default: of --config, else ra4500)",
    )
    make.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="the daemon's configuration: kind and beam of its altimeter (the one of --sensor, else the first of "
        "nav.altimeters) are the defaults, and its alert limit is compared with the protection level",
    )
    make.add_argument(
        "--beam", type=_within(0.1, 120.0, "deg"), metavar="DEG",
        help="full half-power width of a radar's beam as its data sheet states it (default: of --config, else 40)",
    )  # fmt: skip
    make.add_argument(
        "--receiver",
        choices=["drawn", "edge", "nearest"],
        default="drawn",
        help="receivers of a radar that are drawn: leading edge and nearest return (drawn), or one of both alone, when "
        "it is known which the instrument has (drawn)",
    )
    make.add_argument(
        "--nav-vertical-sd", type=_within(0.1, 50.0, "m"), default=3.0, metavar="M",
        help="assumed sigma of the navigated height; as large as the receiver states in flight (3)",
    )  # fmt: skip
    make.add_argument(
        "--nav-horizontal-sd", type=_within(0.1, 50.0, "m"), default=5.0, metavar="M",
        help="assumed sigma of the navigated place (5)",
    )  # fmt: skip
    make.add_argument(
        "--track-sd", type=_within(0.0, 50.0, "m"), default=15.0, metavar="M",
        help="assumed sigma of the flown track beside the published one (15)",
    )  # fmt: skip
    make.add_argument(
        "--elevation-sd", type=_within(0.0, 20.0, "m"), default=2.0, metavar="M",
        help="assumed sigma of the elevation, over 30 m and over 300 m each (2; a surveyed surface model: 0.5)",
    )  # fmt: skip
    make.add_argument(
        "--fitted",
        type=Path,
        metavar="FILE",
        help="the receiver, as fti reference fit --out wrote it, in place of those that are drawn",
    )
    make.add_argument("--s-max", type=_positive, default=7000.0, metavar="M", help="far end of the profile [m]")
    make.add_argument("--runs", type=_count(20), default=2000, help="simulated nominal approaches (2000)")
    make.add_argument(
        "--beside-runs",
        type=_count(2),
        default=100,
        metavar="N",
        help="approaches at each offset beside the track (100)",
    )
    make.add_argument(
        "--obstacle-runs",
        type=_count(0),
        default=100,
        metavar="N",
        help="approaches over obstacles of each width in each kilometre (100); fewer than 99 prove no Pd of 0.97, "
        "0: no table",
    )
    make.add_argument("--draws", type=_count(5), default=100, help="draws of the profile (100)")
    make.add_argument(
        "--pfa",
        type=_probability,
        default=0.01,
        metavar="P",
        help="false alarms per approach, all tests together (0.01)",
    )
    make.add_argument("--seed", type=_count(0), default=1, help="seed of everything random (1)")


def _count(least: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if not text.isdecimal() or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text!r}: must be a whole number from {least}")
        return int(text)

    return parse


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1000.0 <= value <= 50_000.0:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a length of 1000 to 50000 m")
    return value


def _within(least: float, most: float, unit: str) -> Callable[[str], float]:
    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text!r}: must be {least:g} to {most:g} {unit}")
        return value

    return parse


def _date(text: str) -> str:
    try:
        day = date.fromisoformat(text).isoformat()
    except ValueError:
        day = ""
    if day != text:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a day as YYYY-MM-DD")
    return text


def _probability(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1e-5 <= value <= 0.1:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a probability of 0.00001 to 0.1")
    return value
