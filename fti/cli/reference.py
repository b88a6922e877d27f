"""Make and read the reference profile of an approach.

The profile is the terrain along the published path as one kind of altimeter measures it.  ``template`` prints an
airfield file with every key, the input of ``make``.  ``make`` also simulates nominal approaches, on all cores, for the
limits of the integrity monitor's tests.  ``fit`` estimates the receiver parameters of an altimeter from recorded
flights.  ``info`` prints and plots a reference.

    fti reference template --out airfield.toml
    fti reference make --airfield FILE --terrain demo --out configs/profiles/demo.csv
    fti reference make --airfield FILE --terrain dsm_1m.tif srtm.hgt --vertical egm96 --out profiles/27.csv
    fti reference make --airfield FILE --recorded SESSION SESSION --sensor radar_altimeter --out profiles/27.csv
    fti reference make --airfield FILE --terrain demo --out x.csv --runs 50 --seed 7
    fti reference fit SESSION --sensor radar_altimeter --out receiver.toml
    fti reference info configs/profiles/demo.csv
    fti reference info configs/profiles/demo.csv --json
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fti.cli._arguments import new_file
from fti.cli._printing import print_json, print_line, print_lines, write_text
from fti.cli._reference_arguments import MAKE, add_make
from fti.cli._reference_fit import FIT, add_fit, check_output_path, fit, write_output
from fti.errors import ConfigError, MissingError

if TYPE_CHECKING:
    from fti.cli._progress import ShowShare
    from fti.hil.approach_reference.approaches import AltimeterModel, Spread
    from fti.hil.approach_reference.receivers import ReceiverVariant
    from fti.nav.integrity.approach import ApproachPath
    from fti.nav.integrity.reference import ApproachReference, Limits
    from fti.terrain.terrain import Terrain

#: Margin around the approach for which elevation is read [m]: lateral offsets of aircraft, and their beams.
TERRAIN_MARGIN_M = 1500.0
#: A larger post spacing below the track gives a warning [m]: two bins of the profile.
MAX_POST_SPACING_M = 10.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Four actions."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    add_make(
        actions.add_parser(
            "make",
            help="make a reference: profile and limits",
            description=MAKE,
            formatter_class=parser.formatter_class,
        )
    )
    add_fit(
        actions.add_parser(
            "fit",
            help="estimate beam, threshold, bias and scale of an altimeter from recorded flights",
            description=FIT,
            formatter_class=parser.formatter_class,
        )
    )
    template = actions.add_parser("template", help="print an airfield file with every key")
    template.add_argument(
        "--out", type=new_file(".toml"), metavar="FILE", help="write FILE (.toml), instead of the terminal"
    )
    info = actions.add_parser("info", help="print and draw a reference")
    info.add_argument("reference", type=Path, metavar="FILE", help="the reference (CSV)")
    info.add_argument("--json", action="store_true", help="print the header as JSON")


def run(args: argparse.Namespace) -> int:
    """Make, fit, show, or write the template."""
    return {"make": _make, "fit": fit, "info": _info, "template": _write_template}[args.action](args)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise MissingError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is not UTF-8 text") from None


def _write_template(args: argparse.Namespace) -> int:
    from fti.user_files import template

    write_text(template.airfield(), args.out)
    return 0


# ---------------------------------------------------------------------------------------------------------- make


def _make(args: argparse.Namespace) -> int:
    from fti.cli._progress import show_progress
    from fti.cli._reference_altimeter import check_alert_limit, load, model_of
    from fti.nav.integrity.approach import ApproachPath, load_airfield

    config = load(args.config)
    path = ApproachPath(load_airfield(_read(args.airfield), str(args.airfield)))
    check_output_path(args.out)
    with show_progress("recordings" if args.recorded else "terrain") as show:
        make = _from_recordings if args.recorded else _from_terrain
        reference = make(args, path, model_of(args, config), show)
    write_output(args.out, reference.to_text())
    limits = reference.header.limits
    print_line(
        f"{args.out}: {len(reference.s)} points, {limits.runs} approaches, an alarm on {limits.verified_alarms} of "
        f"{limits.verified_runs} others, hash {reference.hash}"
    )
    for remark in _limit_warnings(limits):
        print_line(f"fti: {args.out}: {remark}", error=True)
    check_alert_limit(reference, config, args.out)
    return 0


def _limit_warnings(limits: Limits) -> Iterator[str]:
    from fti.proportions import max_failures_by_chance

    max_alarms = max_failures_by_chance(limits.verified_runs, limits.pfa)
    if limits.verified_alarms > max_alarms:
        yield (
            f"an ALERT on {limits.verified_alarms} of {limits.verified_runs} nominal approaches exceeds a Pfa of "
            f"{limits.pfa:g} (up to {max_alarms} by chance): the limits are too low; simulate more approaches (--runs)"
        )


def _from_terrain(
    args: argparse.Namespace, path: ApproachPath, altimeter: AltimeterModel, show: ShowShare
) -> ApproachReference:
    from fti.hil.approach_reference.approaches import TerrainGround
    from fti.hil.approach_reference.calibration import make_reference
    from fti.hil.approach_reference.options import RECEIVERS, ReferenceOptions
    from fti.parallel_runs import run_all

    altimeter, receivers = _apply_fit(args, altimeter)
    options = ReferenceOptions(
        surface=args.surface or " ".join(Path(name).name for name in args.terrain),
        date=args.date or path.airfield.survey_date,
        s_max=args.s_max,
        draws=args.draws,
        runs=args.runs,
        offset_runs=args.beside_runs,
        obstacle_runs=args.obstacle_runs,
        seed=args.seed,
        pfa=args.pfa,
        spread=_spread(args),
        receiver="fitted" if receivers else args.receiver,
        receivers=len(receivers) or RECEIVERS,
    )
    ground = TerrainGround(path, altimeter, _terrains(args, path, show), receivers=receivers)
    return make_reference(ground, options, show, run_all)


def _apply_fit(
    args: argparse.Namespace, altimeter: AltimeterModel
) -> tuple[AltimeterModel, tuple[ReceiverVariant, ...]]:
    """The altimeter with the fitted beam, and the fitted receiver; empty without --fitted: receivers are random."""
    from fti.hil.approach_reference.fitted_receiver import make_receiver, read_fitted

    if not args.fitted:
        return altimeter, ()
    keys, sensor = read_fitted(args.fitted), altimeter.sensor
    if keys.beam_deg is not None and sensor.kind == "radar":
        sensor = sensor.model_copy(update={"beam_deg": keys.beam_deg})
    return dataclasses.replace(altimeter, sensor=sensor), (make_receiver(sensor, keys),)


def _from_recordings(
    args: argparse.Namespace, path: ApproachPath, altimeter: AltimeterModel, show: ShowShare
) -> ApproachReference:
    from fti.hil.approach_reference.options import ReferenceOptions
    from fti.hil.approach_reference.recorded_approaches import (
        check_sensor,
        date_of,
        profiles_of,
        read_passes,
        reference_from_recordings,
    )
    from fti.parallel_runs import run_all

    passes = []
    for number, folder in enumerate(args.recorded, start=1):
        check_sensor(folder, args.sensor, altimeter)
        passes += read_passes(folder, args.sensor, path, args.s_max)
        show("recordings", number / len(args.recorded))
    profiles = profiles_of(passes, args.s_max)
    options = ReferenceOptions(
        surface=args.surface or args.sensor,
        date=args.date or date_of(passes),
        made_from="recordings",
        s_max=args.s_max,
        draws=len(profiles),
        runs=args.runs,
        seed=args.seed,
        pfa=args.pfa,
        spread=_spread(args),
    )
    return reference_from_recordings(path, altimeter, profiles, options, show, run_all=run_all)


def _spread(args: argparse.Namespace) -> Spread:
    """The assumptions of the limits."""
    from fti.hil.approach_reference.approaches import Spread

    return Spread(
        track=args.track_sd,
        nav_horizontal=args.nav_horizontal_sd,
        nav_vertical=args.nav_vertical_sd,
        dem_short=args.elevation_sd,
        dem_long=args.elevation_sd,
    )


def _terrains(args: argparse.Namespace, path: ApproachPath, show: ShowShare) -> tuple[Terrain, ...]:
    """The demonstration's terrain with low to high vegetation, or the terrain of the files."""
    from fti.terrain.demo_scene import VEGETATION, demo_scene
    from fti.terrain.files.open_terrain import open_terrain

    if args.terrain == ["demo"]:
        scenes = []
        for height in VEGETATION:
            scenes.append(demo_scene(vegetation=height))
            show("terrain", len(scenes) / len(VEGETATION))
        return tuple(scenes)
    lat, lon = path.to_geodetic(args.s_max / 2, 0.0)
    terrain = open_terrain(
        args.terrain,
        centre=(float(lat), float(lon)),
        radius_m=args.s_max / 2 + TERRAIN_MARGIN_M,
        vertical=args.vertical,
        progress=lambda share: show("terrain", share),
    )
    _remark_on_posts(terrain, path, args)
    return (terrain,)


def _remark_on_posts(terrain: Terrain, path: ApproachPath, args: argparse.Namespace) -> None:
    """Warn before the long computation if the post spacing is too coarse for the limits."""
    import numpy as np

    lat, lon = path.to_geodetic(np.linspace(0.0, args.s_max, 100), 0.0)
    place = terrain.frame.to_local(lat, lon, 0.0)
    cell = float(np.max(terrain.cell(place[..., 0], place[..., 1]), initial=0.0))
    if cell > MAX_POST_SPACING_M:
        print_line(
            f"fti: posts below the track are up to {cell:.0f} m apart; the limits assume an elevation error of "
            f"{args.elevation_sd:g} m (--elevation-sd). An obstacle between the posts may raise an ALERT. Test the "
            "reference on a recorded flight (fti reprocess) before use",
            error=True,
        )


def _info(args: argparse.Namespace) -> int:
    from fti.cli._reference_info import plot, summary
    from fti.nav.integrity.reference import ApproachReference

    reference = ApproachReference.parse(_read(args.reference), str(args.reference))
    if args.json:
        print_json({**_finite(reference.header.model_dump()), "hash": reference.hash}, indent=2)
        return 0
    print_lines(summary(reference) + plot(reference))
    return 0


def _finite(value: Any) -> Any:
    """The value for JSON: null for infinity (an obstacle that is not detected at any height)."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, tuple):
        return [_finite(inner) for inner in value]
    return None if value in (math.inf, -math.inf) else value
