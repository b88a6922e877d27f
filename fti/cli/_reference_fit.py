"""``fti reference fit``: its arguments, what it does, and what it prints."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fti.cli._arguments import picture
from fti.cli._printing import print_json, print_line, print_lines
from fti.errors import ConfigError, MissingError

if TYPE_CHECKING:
    from fti.config import Config, Device
    from fti.hil.approach_reference.fit_samples import FitSamples
    from fti.hil.approach_reference.fitted_receiver import FittedReceiver
    from fti.terrain.terrain import Terrain

FIT = """Learn the receiver of an altimeter from recorded flights over known ground.

A reference and the live prediction need the altimeter as it is: the width of its beam, the share of the peak above
which it detects an edge, its bias (bias_m) and its scale.  A data sheet states little of that.  A flight shows each of
them over hills, over woods and in banks.  Both models of [device.altimeter] are tried, "nearest" and "beam", and the
one that explains more of the measurements is taken.

    fti reference fit data/da42_20261121T101500Z_0
    fti reference fit SESSION SESSION --sensor radar_altimeter --out receiver.toml --plot fit.png
    fti reference fit SESSION --config configs/aircraft.toml --model nearest --json

Which flights: some minutes over hills, at the heights that matter, with turns.  The height of the position must not
come from the same altimeter.  Level ground shows neither beam nor threshold, and a constant height shows no scale:
such a parameter stays near the value that is assumed beforehand, and is marked.  A constant error of the navigated
height looks like a bias; its sigma is part of the sigma of the bias, and only more flights reduce it.

The ground is that of [nav.terrain] in the recorded configuration, or in --config.  Sessions without outputs: fti
reprocess first.  --out writes the keys for [device.altimeter] of that device:

    [device.altimeter]
    model = "nearest"
    beam_deg = 58.9
    bias_m = 2.1
    scale = 1.009

"beam" takes about a minute for 1000 samples.  The result counts for that altimeter at that place of the aircraft.
"""


def add_fit(fit: argparse.ArgumentParser) -> None:
    """Its arguments."""
    fit.add_argument("sessions", nargs="+", type=Path, metavar="SESSION", help="recorded flights over known ground")
    fit.add_argument("--sensor", default="altimeter", metavar="NAME", help="their altimeter (altimeter)")
    fit.add_argument(
        "--config", type=Path, metavar="FILE", help="take terrain, mounting and altimeter from here, not the recordings"
    )
    fit.add_argument(
        "--model", choices=["auto", "nearest", "beam"], default="auto", help="of the receiver (auto: what fits better)"
    )
    fit.add_argument(
        "--samples", type=_count, default=1000, metavar="N", help="use so many, evenly spread over all flights (1000)"
    )
    fit.add_argument("--out", type=Path, metavar="FILE", help="write the keys for [device.altimeter] (TOML)")
    fit.add_argument("--plot", type=picture, metavar="FILE", help="draw the residuals: FILE.png or FILE.svg, new")
    fit.add_argument("--json", action="store_true", help="print one JSON object")


def _count(text: str) -> int:
    if not text.isdecimal() or not 50 <= int(text) <= 100_000:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a whole number from 50 to 100000")
    return int(text)


def fit(args: argparse.Namespace) -> int:
    """Fit, print, write."""
    from fti.cli._read_report import progress_bar
    from fti.cli._reference_fit_plot import write_plot
    from fti.hil.approach_reference.fitted_receiver import as_toml, fit_receiver

    if args.out is not None:
        check_output_path(args.out)
    with progress_bar() as bar:
        reading, loading = bar.add_task("recordings", total=len(args.sessions)), bar.add_task("terrain", total=1.0)
        fitting = bar.add_task("fit", total=1.0)
        device, samples = _read(args, lambda n: bar.update(reading, completed=n))
        terrain = _load_terrain(args, lambda share: bar.update(loading, completed=share))
        found = fit_receiver(
            device,
            terrain,
            samples,
            models=("nearest", "beam") if args.model == "auto" else (args.model,),
            count=args.samples,
            progress=lambda share: bar.update(fitting, completed=share),
        )
    if args.json:
        print_json(_as_json(found, args), indent=2)
    else:
        print_lines(_as_text(found, args))
    if args.out is not None:
        _write(args.out, as_toml(found, args.sensor, [str(session) for session in args.sessions]))
    if args.plot is not None:
        write_plot(found, args.sensor, args.plot)
    return 0


def check_output_path(out: Path) -> None:
    """Whether a file can be written: better known before the minutes that it takes than after."""
    import os

    folder = next(parent for parent in out.absolute().parents if parent.exists())
    if out.is_dir() or not folder.is_dir():
        raise ConfigError(f"{out}: cannot be written: {'is a folder' if out.is_dir() else f'{folder} is no folder'}")
    if not os.access(out if out.exists() else folder, os.W_OK):
        raise ConfigError(f"{out}: cannot be written: permission denied")


def _config_of(args: argparse.Namespace, session: Path) -> Config:
    from fti import config as configuration
    from fti.logger.reading.recording import Recording
    from fti.post.reprocess import recorded_setup

    return configuration.load(args.config) if args.config else recorded_setup(Recording.open(session), session).config


def _read(args: argparse.Namespace, progress: Any) -> tuple[Device, FitSamples]:
    """The device, which is the same in all sessions, and the samples of all."""
    from fti.config import Device
    from fti.hil.approach_reference.fit_samples import FitSamples, concatenate_samples, read_samples

    devices, parts = list[Device](), list[FitSamples]()
    for number, session in enumerate(args.sessions):
        where = args.config or session
        device = _config_of(args, session).find_device(args.sensor)
        if device is None or device.altimeter is None:
            raise ConfigError(f"{where}: device: has no altimeter {args.sensor!r} (--sensor)")
        if devices and _mounting(device) != _mounting(devices[0]):
            raise ConfigError(
                f"{where}: device {args.sensor!r}: another kind, lever arm or mounting than in {args.sessions[0]}; "
                "one fit is of one altimeter in one place"
            )
        devices.append(device)
        parts.append(read_samples(session, args.sensor, number))
        progress(number + 1)
    return devices[0], concatenate_samples(parts)


def _mounting(device: Device) -> tuple[object, ...]:
    assert device.altimeter is not None
    return device.altimeter.kind, device.lever_arm_b, device.rpy_bs_deg


def _load_terrain(args: argparse.Namespace, progress: Any) -> Terrain:
    from fti.service.navigation.terrain_loader import load_terrain

    settings = _config_of(args, args.sessions[0]).nav.terrain
    if settings is None:
        raise MissingError(
            f"{args.config or args.sessions[0]}: nav.terrain: is missing; a fit needs known ground (--config)"
        )
    return load_terrain(settings, progress, local_only=args.config is None).terrain


def _write(out: Path, text: str) -> None:
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{out}: cannot be written: {error.strerror}") from None
    print_line(out)


_DIGITS = {"beam_deg": 2, "threshold_db": 1, "bias_m": 2, "scale": 4}


def _as_text(found: FittedReceiver, args: argparse.Namespace) -> Iterator[str]:
    used, count = int(found.used.sum()), len(found.samples)
    yield (
        f"{args.sensor}: {used} of {count} samples count, of {found.available} in {len(args.sessions)} "
        f"session{'s' if len(args.sessions) > 1 else ''}; the others are outliers, or have no prediction"
    )
    rivals = "; ".join(f"{model!r} leaves {sd:.2f} m" for model, sd in found.others.items())
    yield f"  model         {found.model}{f' ({found.fit.sd:.2f} m of scatter are left; {rivals})' if rivals else ''}"
    for name, value, sd, configured in found.rows():
        digits = _DIGITS[name]
        was = "default" if configured is None else f"{configured:g}"
        remark = (
            "; hardly more than what was assumed: not shown by these flights" if name in found.fit.unobservable else ""
        )
        yield f"  {name:12}  {value:.{digits}f} +- {sd:.{digits}f} (configured: {was}){remark}"
    before, after = found.rms()
    yield f"  residual      {before:.2f} m RMS as configured, {after:.2f} m as fitted"


def _as_json(found: FittedReceiver, args: argparse.Namespace) -> dict[str, Any]:
    before, after = found.rms()
    return {
        "sensor": args.sensor,
        "sessions": [str(session) for session in args.sessions],
        "model": found.model,
        "parameters": {
            name: {"value": value, "sd": sd, "configured": configured, "assumed": name in found.fit.unobservable}
            for name, value, sd, configured in found.rows()
        },
        "rms_before_m": before,
        "rms_after_m": after,
        "other_models": {model: {"scatter_m": sd} for model, sd in found.others.items()},
        "scatter_m": found.fit.sd,
        "samples": int(found.used.sum()),
        "samples_looked_at": len(found.samples),
        "samples_available": found.available,
    }
