"""Make and read the reference profile of an approach.

The profile is what one kind of altimeter sees of the terrain along the published path; with it come the limits of the
integrity monitor's tests, from simulated nominal approaches, over as many processes as there are cores.  ``info``
prints what a reference holds and draws it.

    fti reference make --airfield FILE --terrain demo --out configs/profiles/demo.csv
    fti reference make --airfield FILE --terrain dsm_1m.tif srtm.hgt --vertical egm96 --out profiles/27.csv
    fti reference make --airfield FILE --recorded SESSION SESSION --sensor radar_altimeter --out profiles/27.csv
    fti reference make --airfield FILE --terrain demo --out x.csv --runs 50 --seed 7
    fti reference info configs/profiles/demo.csv
    fti reference info configs/profiles/demo.csv --json
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from fti.errors import ConfigError, MissingError

if TYPE_CHECKING:
    from fti.hil.references.approaches import AltimeterModel
    from fti.nav.integrity.approach import ApproachPath
    from fti.nav.integrity.reference import Detection, Reference
    from fti.terrain.terrain import Terrain

PLOT_ROWS, PLOT_COLUMNS = 16, 96
#: How far around the approach elevation is read [m]: aircraft beside the track, and their beams.
AROUND_M = 1500.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Two actions."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    make = actions.add_parser("make", help="make a reference: profile and limits")
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
        "--date", metavar="YYYY-MM-DD", help="of its survey (default: the airfield's, or the last recording's)"
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
    make.add_argument("--draws", type=_count(5), default=100, help="draws of the profile (100)")
    make.add_argument(
        "--pfa",
        type=_probability,
        default=0.01,
        metavar="P",
        help="false alarms per approach, all tests together (0.01)",
    )
    make.add_argument("--seed", type=_count(0), default=1, help="seed of everything random (1)")
    info = actions.add_parser("info", help="print and draw a reference")
    info.add_argument("reference", type=Path, metavar="FILE")
    info.add_argument("--json", action="store_true", help="what the reference says of itself, as JSON")


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


def _probability(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1e-5 <= value <= 0.1:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a probability of 0.00001 to 0.1")
    return value


def run(args: argparse.Namespace) -> int:
    """Make or show."""
    return _make(args) if args.action == "make" else _info(args)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise MissingError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is not UTF-8 text") from None


# ---------------------------------------------------------------------------------------------------------- make


def _make(args: argparse.Namespace) -> int:
    from fti.hil.references.approaches import MODELS
    from fti.nav.integrity.approach import ApproachPath, load_airfield

    path = ApproachPath(load_airfield(_read(args.airfield), str(args.airfield)))
    with _Bars() as bars:
        make = _from_recordings if args.recorded else _from_terrain
        reference = make(args, path, MODELS[args.altimeter], bars)
    try:
        args.out.parent.mkdir(parents=True, exist_ok=True)
        args.out.write_text(reference.to_text(), encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{args.out}: cannot be written: {error.strerror}") from None
    limits = reference.header.limits
    print(
        f"{args.out}: {len(reference.s)} points, {limits.runs} approaches, an alarm on {limits.verified_alarms} of "
        f"{limits.verified_runs} others, hash {reference.hash}"
    )
    return 0


def _from_terrain(args: argparse.Namespace, path: ApproachPath, altimeter: AltimeterModel, bars: _Bars) -> Reference:
    from fti.hil.references.approaches import TerrainGround
    from fti.hil.references.calibration import make_reference
    from fti.hil.references.plan import Plan
    from fti.study.workers import run_all

    plan = Plan(
        surface=args.surface or " ".join(Path(name).name for name in args.terrain),
        date=args.date or path.airfield.survey_date,
        s_max=args.s_max,
        draws=args.draws,
        runs=args.runs,
        beside_runs=args.beside_runs,
        seed=args.seed,
        pfa=args.pfa,
    )
    ground = TerrainGround(path, altimeter, _terrains(args, path, bars))
    return make_reference(ground, plan, bars.update, run_all)


def _from_recordings(args: argparse.Namespace, path: ApproachPath, altimeter: AltimeterModel, bars: _Bars) -> Reference:
    from fti.hil.references.plan import Plan
    from fti.hil.references.recordings import (
        check_sensor,
        date_of,
        profiles_of,
        read_passes,
        reference_from_recordings,
    )
    from fti.study.workers import run_all

    passes = []
    for number, folder in enumerate(args.recorded, start=1):
        check_sensor(folder, args.sensor, altimeter)
        passes += read_passes(folder, args.sensor, path, args.s_max)
        bars.update("recordings", number / len(args.recorded))
    profiles = profiles_of(passes, args.s_max)
    plan = Plan(
        surface=args.surface or args.sensor,
        date=args.date or date_of(passes),
        made_from="recordings",
        s_max=args.s_max,
        draws=len(profiles),
        runs=args.runs,
        seed=args.seed,
        pfa=args.pfa,
    )
    return reference_from_recordings(path, altimeter, profiles, plan, bars.update, run_all=run_all)


def _terrains(args: argparse.Namespace, path: ApproachPath, bars: _Bars) -> tuple[Terrain, ...]:
    """The demonstration's terrain with its vegetation low to high, or the one that the files make."""
    from fti.terrain.scenes import VEGETATION, demo_scene
    from fti.terrain.terrain import Terrain

    if args.terrain == ["demo"]:
        scenes = []
        for height in VEGETATION:
            scenes.append(demo_scene(vegetation=height))
            bars.update("terrain", len(scenes) / len(VEGETATION))
        return tuple(scenes)
    lat, lon = path.geodetic(args.s_max / 2, 0.0)
    return (
        Terrain.open(
            args.terrain,
            centre=(float(lat), float(lon)),
            radius_m=args.s_max / 2 + AROUND_M,
            vertical=args.vertical,
            progress=lambda share: bars.update("terrain", share),
        ),
    )


class _Bars(AbstractContextManager["_Bars"]):
    """A progress bar per kind of work, on standard error; nothing when that is no terminal."""

    def __enter__(self) -> _Bars:
        from rich.console import Console
        from rich.progress import Progress, TaskID

        console = Console(stderr=True)
        self._tasks: dict[str, TaskID] = {}
        self._progress = Progress(console=console) if console.is_terminal else None
        (self._progress or nullcontext()).__enter__()
        return self

    def __exit__(self, *exception: object) -> None:
        if self._progress:
            self._progress.stop()

    def update(self, what: str, share: float) -> None:
        """So much is done, 0 to 1."""
        if self._progress is None:
            return
        if what not in self._tasks:
            self._tasks[what] = self._progress.add_task(what, total=1.0)
        self._progress.update(self._tasks[what], completed=share)


# ---------------------------------------------------------------------------------------------------------- info


def _info(args: argparse.Namespace) -> int:
    from fti.nav.integrity.reference import Reference

    reference = Reference.parse(_read(args.reference), str(args.reference))
    if args.json:
        json.dump({**reference.header.model_dump(), "hash": reference.hash}, sys.stdout, indent=2)
        print()
        return 0
    for line in _summary(reference) + _plot(reference):
        print(line)
    return 0


def _summary(reference: Reference) -> list[str]:
    header = reference.header
    airfield, profile, limits = header.airfield, header.profile, header.limits
    return [
        f"airfield     {airfield.name}, surveyed {airfield.survey_date}",
        f"glide path   {airfield.glide_deg} deg, course {airfield.course_deg} deg, TCH {airfield.tch_m} m",
        f"sensor       {header.sensor.kind}, beam {header.sensor.beam_deg} deg",
        f"profile      {profile.surface} of {profile.date}, s -200 to {profile.s_max_m + 200:.0f} m, step "
        f"{profile.ds_m} m, from {profile.made_from}, {profile.draws} draws, seed {profile.seed}",
        f"window       {profile.window_m} m, correlation length {profile.correlation_m} m",
        f"limits       T1 {limits.t1}  T2 {limits.t2}  T3 {limits.t3}  T4 {limits.t4}  "
        f"(Pfa {limits.pfa}, Pmd {limits.pmd}, {limits.runs} approaches)",
        f"verified     an alarm on {limits.verified_alarms} of {limits.verified_runs} other approaches",
        *_beside(header.detection),
        f"sigma        {reference.s_ref.min():.2f} to {reference.s_ref.max():.2f} m",
        f"hash         {reference.hash}",
    ]


def _beside(detection: Detection | None) -> Iterator[str]:
    """Share of windows in ALERT, by the offset from the track and the part of the way."""
    if detection is None:
        return
    yield f"{'beside':>12} " + "".join(f"{s:7.0f}" for s in detection.s_m) + "  m and less before the intercept point"
    for y, row in zip(detection.y_m, detection.pd, strict=True):
        yield f"{y:10.0f} m " + "".join(f"{100 * pd:6.1f}%" for pd in row) + "  of the windows are an ALERT"


def _plot(reference: Reference) -> list[str]:
    """Glide path (.) over the terrain as the sensor sees it (#), far end on the left."""
    import numpy as np

    from fti.nav.integrity.approach import ApproachPath

    s = np.linspace(reference.s[-1], reference.s[0], PLOT_COLUMNS)
    z = np.interp(s, reference.s, reference.z_ref)
    path = ApproachPath(reference.header.airfield).alt_path(s)
    low, high = float(min(z.min(), path.min())), float(max(z.max(), path.max()))
    levels = np.linspace(high, low, PLOT_ROWS)
    half = (high - low) / (PLOT_ROWS - 1) / 2
    rows = []
    for level in levels:
        marks = np.where(np.abs(path - level) <= half, ".", np.where(z >= level - half, "#", " "))
        rows.append(f"{level:6.0f} m |" + "".join(marks))
    return ["", *rows, f"          {s[0]:.0f} m{'before the intercept point'.center(PLOT_COLUMNS - 14)}{s[-1]:.0f} m"]
