"""Arguments and description of ``fti reference make``."""

from __future__ import annotations

import argparse
from datetime import date
from pathlib import Path

from fti.cli._arguments import number, whole_number

MAKE = """Make the reference of an approach: its profile and the limits of the tests.

    fti reference make --airfield FILE --terrain dsm_1m.tif srtm.hgt --vertical egm96 --out profiles/27.csv
    fti reference make --airfield FILE --recorded SESSION SESSION --sensor radar_altimeter --out profiles/27.csv

From terrain: the elevation files must cover the approach to 250 m beyond --s-max and 1500 m to each side.  Vegetation
is modelled as in the files: only recorded approaches include seasonal changes in the limits.  The file also states
the smallest detectable obstacle for each width and section of the approach.

The receiver parameters are random: antenna pattern, beam width (10 % around the stated one), detection threshold (3 to
13 dB below the peak) and range bias; for a laser first or last echo and pointing.  The profile's sigma includes the
spread.

The limits are valid for the assumptions in the file: sigmas of navigation, track and elevation, beam of the altimeter.
If navigation states more than 1.25 times an assumed sigma in flight, integrity is unavailable (assumption).  Larger
assumptions mean fewer alarms and later detection.

--fitted: use the receiver that fti reference fit found on flights instead of the stated beam.

From recordings: at least 5 approaches from --s-max on, in one or more sessions, with a height every 20 m, and with
navigation that did not use the same altimeter.  An aborted approach counts up to its end; each point needs the heights
of 3 approaches, and fewer approaches give a larger sigma.  Sessions without outputs: run fti reprocess first.

2000 approaches of 7 km take some minutes of one core; a tenth of them gives only rough limits.  Then add to the
daemon's configuration (the path is relative to it):

    [nav.approach]
    profile = "profiles/27.csv"
    alert_v_m = 30.0        # at least the protection level that this command prints
"""


def add_make(make: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    make.add_argument("--airfield", required=True, type=Path, metavar="FILE", help="the airfield file (TOML)")
    source = make.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "--recorded", nargs="+", type=Path, metavar="SESSION", help="recorded flights with 5 approaches or more"
    )
    make.add_argument(
        "--sensor", default="altimeter", metavar="NAME", help="altimeter of recordings or --config (default: altimeter)"
    )
    source.add_argument("--terrain", nargs="+", metavar="FILE", help="elevation files below the approach, or: demo")
    make.add_argument("--vertical", choices=["egm96", "egm2008", "ellipsoid"], help="datum of files that state none")
    make.add_argument("--surface", metavar="NAME", help="name of the surface (default: the files)")
    make.add_argument(
        "--date",
        type=_date,
        metavar="YYYY-MM-DD",
        help="date of the survey (default: the airfield's, or the last recording's)",
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
        help="the daemon's configuration: gives the default kind and beam of the altimeter (--sensor, else the first "
        "of nav.altimeters); its alert limit is compared with the protection level",
    )
    make.add_argument(
        "--beam", type=number(0.1, 120.0, "0.1 to 120 deg"), metavar="DEG",
        help="full half-power width of a radar's beam as its data sheet states it (default: of --config, else 40)",
    )  # fmt: skip
    make.add_argument(
        "--receiver",
        choices=["drawn", "edge", "nearest"],
        default="drawn",
        help="random receivers of a radar: leading edge and nearest return (drawn), or only the one that the "
        "instrument is known to have (default: drawn)",
    )
    make.add_argument(
        "--nav-vertical-sd", type=number(0.1, 50.0, "0.1 to 50 m"), default=3.0, metavar="M",
        help="assumed sigma of the navigated height; as the receiver states it in flight (default: 3)",
    )  # fmt: skip
    make.add_argument(
        "--nav-horizontal-sd", type=number(0.1, 50.0, "0.1 to 50 m"), default=5.0, metavar="M",
        help="assumed sigma of the navigated horizontal position (default: 5)",
    )  # fmt: skip
    make.add_argument(
        "--track-sd", type=number(0.0, 50.0, "0 to 50 m"), default=15.0, metavar="M",
        help="assumed sigma of the cross-track deviation from the published track (default: 15)",
    )  # fmt: skip
    make.add_argument(
        "--elevation-sd", type=number(0.0, 20.0, "0 to 20 m"), default=2.0, metavar="M",
        help="assumed sigma of the elevation, over 30 m and over 300 m each (default: 2; surveyed surface model: 0.5)",
    )  # fmt: skip
    make.add_argument(
        "--fitted",
        type=Path,
        metavar="FILE",
        help="receiver file of fti reference fit --out, instead of random receivers",
    )
    make.add_argument(
        "--s-max",
        type=number(1000.0, 50_000.0, "a length of 1000 to 50000 m"),
        default=7000.0,
        metavar="M",
        help="far end of the profile [m]",
    )
    make.add_argument(
        "--runs", type=whole_number(20), default=2000, help="simulated nominal approaches (default: 2000)"
    )
    make.add_argument(
        "--beside-runs",
        type=whole_number(2),
        default=100,
        metavar="N",
        help="approaches at each lateral offset from the track (default: 100)",
    )
    make.add_argument(
        "--obstacle-runs",
        type=whole_number(0),
        default=100,
        metavar="N",
        help="approaches over obstacles of each width in each kilometre (default: 100); fewer than 99 do not prove a "
        "Pd of 0.97, 0: no table",
    )
    make.add_argument("--draws", type=whole_number(5), default=100, help="random draws of the profile (default: 100)")
    make.add_argument(
        "--pfa",
        type=number(1e-5, 0.1, "a probability of 0.00001 to 0.1"),
        default=0.01,
        metavar="P",
        help="false alarms per approach, all tests together (default: 0.01)",
    )
    make.add_argument("--seed", type=whole_number(0), default=1, help="seed of the random numbers (default: 1)")


def _date(text: str) -> str:
    try:
        day = date.fromisoformat(text).isoformat()
    except ValueError:
        day = ""
    if day != text:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a date, YYYY-MM-DD")
    return text
