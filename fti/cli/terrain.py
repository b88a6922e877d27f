"""Show, plot and analyse elevation files, and compare them with a recorded flight.

Reads GeoTIFF, DTED (.dt0 .dt1 .dt2), SRTM (.hgt) and all other formats of GDAL, in any coordinate system, many files
and resolutions at once.  ``info`` prints for each file its size, coordinates, post spacing in metres, vertical datum
with its source, lowest and highest height, holes and coverage; then the layers of the combined terrain, the seams, and
the resampling error of each layer.  ``plot`` draws that terrain: relief, hatched holes, seams, source files.
``spectrum`` prints which waves of the finest layer carry its heights and slopes, how often a sensor has to sample them
at a speed, and the correlation length.  ``judge`` compares elevation models with the ground that the altimeters of a
recorded flight measured (``fti terrain judge --help``).  ``strips`` prints the shift between two strips of a laser
scanner (``fti terrain strips --help``).

  fti terrain info N47E011.hgt N47E012.hgt
  fti terrain info dsm_1m.tif srtm.hgt --vertical dsm_1m.tif=egm96 --json
  fti terrain spectrum dsm_1m.tif --vertical egm96 --at 47.9,11.8 --radius 2000 --speed 60 --out spectrum.png
  fti terrain plot *.dt2 --at 47.9,11.8 --radius 5000 --out map.png
  fti terrain plot dsm_1m.tif srtm.hgt --vertical egm96 --out map.svg --profile 47.90,11.75/47.90,11.85
  fti terrain judge SESSION dsm_1m.tif srtm.hgt --vertical dsm_1m.tif=egm96 --plot judge.png

A height needs a vertical datum.  The coordinate system or the format of a file states it: DTED and HGT are above mean
sea level (EGM96).  For other files --vertical is required; a wrong datum is an error of 47 m in central Europe.  egm96
needs the geoid grid (Debian package proj-data).  Write a southern latitude with "=": --at=-33.9,18.4

See also docs/terrain.md.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

from fti.cli._arguments import MIN_POSITIVE, number, picture
from fti.cli._printing import print_json, print_line, print_lines
from fti.cli._terrain_judge import JUDGE, add_judge, judge_maps
from fti.cli._terrain_strips import STRIPS, add_strips, compare

INFO = """Print the elevation files, and the layers, seams and resampling errors of their combined terrain.

  fti terrain info N47E011.hgt N47E012.hgt
"""
PLOT = """Plot the combined terrain: relief, hatched holes, seams, source files.

  fti terrain plot *.dt2 --at 47.9,11.8 --radius 5000 --out map.png
"""
SPECTRUM = """Print which waves of the relief carry its heights and slopes, and how often a sensor has to sample them.

  fti terrain spectrum N47E011.hgt --at 47.9,11.8 --radius 2000 --speed 60 --out spectrum.png

Use it to judge whether terrain and altimeter suit [nav.terrain_position].  A position from a height profile depends on
the slopes: an altimeter with less than their rate loses information, and one with more than the rate of the posts gains
none.  The correlation length is the distance after which heights are a new piece of terrain: a profile should be
several times as long.  Where 'sd' of the slopes is small, the ground is flat and gives no position.
"""
Place = tuple[float, float]
LENGTH = number(MIN_POSITIVE, 1e6, "a length above 0 and up to 1000000 m")
SPEED = number(MIN_POSITIVE, 1e4, "a speed above 0 and up to 10000 m/s")
SHARE = number(0.01, 0.999, "a share of 0.01 to 0.999")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Five actions."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    layout = parser.formatter_class
    info = actions.add_parser(
        "info", help="print the files and the layers of the terrain", description=INFO, formatter_class=layout
    )
    _add_files(info)
    info.add_argument("--json", action="store_true", help="print one JSON object")
    plot = actions.add_parser("plot", help="plot the terrain", description=PLOT, formatter_class=layout)
    _add_files(plot)
    plot.add_argument(
        "--out", required=True, type=picture, metavar="FILE", help="the plot (.png, .svg; must not exist)"
    )
    plot.add_argument(
        "--profile", type=_line, metavar="LAT,LON/LAT,LON", help="also plot the profile between two points [deg]"
    )
    spectrum = actions.add_parser(
        "spectrum",
        help="print the spectrum of the finest layer, and sampling rates",
        description=SPECTRUM,
        formatter_class=layout,
    )
    _add_files(spectrum)
    spectrum.add_argument("--speed", type=SPEED, default=60.0, metavar="MPS", help="over the ground [m/s] (60)")
    spectrum.add_argument("--share", type=SHARE, default=0.9, metavar="X", help="of the variance to be sampled (0.9)")
    spectrum.add_argument("--out", type=picture, metavar="FILE", help="also plot it (.png, .svg; must not exist)")
    spectrum.add_argument("--json", action="store_true", help="print one JSON object")
    judge = actions.add_parser(
        "judge",
        help="compare elevation models with the altimeters of a recorded flight",
        description=JUDGE,
        formatter_class=layout,
    )
    add_judge(judge)
    _add_opening(judge)
    strips = actions.add_parser(
        "strips",
        help="print the shift between two strips of a laser scanner",
        description=STRIPS,
        formatter_class=layout,
    )
    add_strips(strips)


def _add_files(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", nargs="+", metavar="FILE", help="elevation files; where two overlap the finer is used")
    parser.add_argument("--at", type=_place, metavar="LAT,LON", help="only around this point [deg], with --radius")
    parser.add_argument("--radius", type=LENGTH, metavar="M", help="half the side of the square around it [m]")
    _add_opening(parser)


def _add_opening(parser: argparse.ArgumentParser) -> None:
    """Vertical datum and post spacing."""
    parser.add_argument(
        "--vertical",
        action="append",
        default=[],
        metavar="DATUM",
        help="egm96, egm2008 or ellipsoid: datum of files that state none; FILE=DATUM: of one file; may be repeated",
    )
    parser.add_argument("--cell", type=LENGTH, metavar="M", help="post spacing of the finest layer [m] (the file's)")


def _place(text: str) -> Place:
    try:
        lat, lon = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: must be latitude,longitude in degrees, as 47.9,11.8") from None
    if not (abs(lat) <= 90.0 and abs(lon) <= 360.0):
        raise argparse.ArgumentTypeError(f"{text}: must be -90 to 90 and -360 to 360 degrees")
    return math.radians(lat), math.radians(lon)


def _line(text: str) -> tuple[Place, Place]:
    ends = text.split("/")
    if len(ends) != 2:
        raise argparse.ArgumentTypeError(f"{text!r}: must be two points, as 47.88,11.75/47.92,11.85")
    return _place(ends[0]), _place(ends[1])


def run(args: argparse.Namespace) -> int:
    """Print, draw, analyse or compare."""
    return {"info": _info, "plot": _plot, "spectrum": _spectrum, "judge": _judge, "strips": compare}[args.action](args)


def _arguments(args: argparse.Namespace) -> dict[str, Any]:
    """Arguments of ``open_terrain`` and ``survey``, without the files."""
    if (args.at is None) != (args.radius is None):
        args.parser.error("--at, --radius: only both together")
    return {"centre": args.at, "radius_m": args.radius, "cell_m": args.cell, "vertical": _datums(args)}


def _datums(args: argparse.Namespace) -> dict[str, str]:
    """Vertical datum by file; ``*``: of the others."""
    vertical: dict[str, str] = {}
    for word in args.vertical:
        file, _, datum = word.rpartition("=")
        if vertical.setdefault(file or "*", datum) != datum:
            args.parser.error(f"--vertical {word}: contradicts the earlier {vertical[file or '*']}")
    return vertical


def _judge(args: argparse.Namespace) -> int:
    return judge_maps(args, _datums(args))


def _info(args: argparse.Namespace) -> int:
    from fti.cli._progress import show_progress
    from fti.cli._terrain_view import as_json, as_text
    from fti.terrain.files.file_survey import survey

    with show_progress("reading") as show:
        found = survey(args.files, **_arguments(args), progress=lambda share: show("reading", share))
    print_json(as_json(found), indent=2) if args.json else print_lines(as_text(found))
    return 0


def _plot(args: argparse.Namespace) -> int:
    from fti.cli._progress import show_progress
    from fti.cli._terrain_map import draw_map
    from fti.plot_style import write_figure
    from fti.terrain.files.open_terrain import open_terrain

    with show_progress("reading") as show:
        terrain = open_terrain(args.files, **_arguments(args), progress=lambda share: show("reading", share))
        show("drawing")
        write_figure(lambda: draw_map(terrain, args.profile), args.out)
    print_line(args.out)
    return 0


def _spectrum(args: argparse.Namespace) -> int:
    from fti.cli._progress import show_progress
    from fti.cli._terrain_spectrum import as_json, as_text, draw_spectrum
    from fti.errors import ConfigError
    from fti.plot_style import write_figure
    from fti.terrain.files.open_terrain import open_terrain
    from fti.terrain.spectrum import analyse_spectrum

    with show_progress("reading") as show:
        terrain = open_terrain(args.files, **_arguments(args), progress=lambda share: show("reading", share))
        show("analysing")
        try:
            spectrum = analyse_spectrum(terrain.finest)
        except ValueError as error:
            raise ConfigError(f"{', '.join(args.files)}: {error}; choose another area with --at and --radius") from None
        found = as_json(spectrum, args.share, args.speed)
        if args.out:
            write_figure(lambda: draw_spectrum(spectrum, args.share), args.out)
    print_json(found, indent=2) if args.json else print_lines(as_text(found))
    if args.out and not args.json:
        print_line(args.out)
    return 0
