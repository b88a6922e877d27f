"""The arguments of ``fti reference make``, and the text above them."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from datetime import date
from pathlib import Path

MAKE = """Make the reference of an approach: its profile and the limits of the tests.

    fti reference make --airfield FILE --terrain dsm_1m.tif srtm.hgt --vertical egm96 --out profiles/27.csv
    fti reference make --airfield FILE --recorded SESSION SESSION --sensor radar_altimeter --out profiles/27.csv

From terrain: the elevation files must cover the approach to 200 m beyond --s-max, 1500 m to each side.  What grows on
the ground is as the files have it: seasons are in the limits only where the approaches were recorded.  The smallest
obstacle that is seen, by its width and the part of the way, is in the file, too.

From recordings: 5 approaches or more from --s-max on, in one session or many, with a height every 20 m, and navigation
that did not rest on the same altimeter.  One that was broken off counts as far as it went; each place needs the heights
of 3, and its sigma is the larger, the fewer there are.  Sessions without outputs: fti reprocess first.

2000 approaches of 7 km take some minutes of a core; with a tenth of them the limits are guesses.  Then, in the
daemon's configuration, with its path from there:

    [nav.approach]
    profile = "profiles/27.csv"
"""


def add_make(make: argparse.ArgumentParser) -> None:
    """Its arguments."""
    make.add_argument("--airfield", required=True, type=Path, metavar="FILE", help="the airfield file (TOML)")
    source = make.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "--recorded", nargs="+", type=Path, metavar="SESSION", help="recorded flights with 5 approaches or more"
    )
    make.add_argument("--sensor", default="altimeter", metavar="NAME", help="their altimeter (altimeter)")
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
    make.add_argument("--altimeter", choices=["ra4500", "laser"], default="ra4500", help="kind of altimeter (ra4500)")
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
