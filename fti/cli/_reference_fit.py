"""``fti reference fit``: arguments, fit and output."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fti.cli._arguments import picture, whole_number
from fti.cli._printing import print_json, print_line, print_lines
from fti.errors import ConfigError, MissingError

if TYPE_CHECKING:
    from fti.config import Config, Device
    from fti.hil.approach_reference.fit_samples import FitSamples
    from fti.hil.approach_reference.fitted_receiver import FittedReceiver

FIT = """Estimate the receiver parameters of an altimeter from recorded flights over known terrain.

A reference and the live prediction need the real parameters of the altimeter: beam width, detection threshold relative
to the peak, bias (bias_m) and scale.  A data sheet states few of them.  Flights over hills and woods, and banked
flight, make them observable.  Both models of [device.altimeter], "nearest" and "beam", are fitted, and the one with
the smaller residual is taken.

    fti reference fit data/da42_20261121T101500Z_0
    fti reference fit SESSION SESSION --sensor radar_altimeter --out receiver.toml --plot fit.png
    fti reference fit SESSION --config configs/aircraft.toml --model nearest --json

Suitable flights: some minutes over hills, at the heights of interest, with turns.  The navigated height must not come
from the same altimeter.  Over level ground beam and threshold are not observable, at constant height the scale is not:
such a parameter stays near its prior value, and is marked.  A constant error of the navigated height looks like a
bias; the sigma of the bias includes its sigma, and only more flights reduce it.

The terrain is [nav.terrain] of the recorded configuration, or of --config.  Sessions without outputs: run fti
reprocess first.  --out writes the keys for [device.altimeter] of that device:

    [device.altimeter]
    model = "nearest"
    beam_deg = 58.9
    bias_m = 2.1
    scale = 1.009

"beam" takes about a minute for 1000 samples.  The result is valid for that altimeter in that mounting position.
"""


def add_fit(fit: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    fit.add_argument("sessions", nargs="+", type=Path, metavar="SESSION", help="recorded flights over known terrain")
    fit.add_argument("--sensor", default="altimeter", metavar="NAME", help="the altimeter (default: altimeter)")
    fit.add_argument(
        "--config", type=Path, metavar="FILE", help="take terrain, mounting and altimeter from here, not the recordings"
    )
    fit.add_argument(
        "--model", choices=["auto", "nearest", "beam"], default="auto", help="receiver model (default: auto, best fit)"
    )
    fit.add_argument(
        "--samples",
        type=whole_number(50, 100_000),
        default=1000,
        metavar="N",
        help="samples, evenly spread over all flights (1000)",
    )
    fit.add_argument("--out", type=Path, metavar="FILE", help="write the keys for [device.altimeter] (TOML)")
    fit.add_argument(
        "--plot", type=picture, metavar="FILE", help="plot the residuals to FILE (.png, .svg; must not exist)"
    )
    fit.add_argument("--json", action="store_true", help="print one JSON object")


def fit(args: argparse.Namespace) -> int:
    """Fit, print, write."""
    from fti.cli._progress import show_progress
    from fti.cli._reference_fit_plot import draw_fit
    from fti.hil.approach_reference.fitted_receiver import as_toml, fit_receiver
    from fti.plot_style import write_figure
    from fti.service.navigation.terrain_loader import load_terrain

    if args.out is not None:
        check_output_path(args.out)
    with show_progress("recordings") as show:
        device, samples = _read(args, lambda number: show("recordings", number / len(args.sessions)))
        settings = _config_of(args, args.sessions[0]).nav.terrain
        if settings is None:
            where = args.config or args.sessions[0]
            raise MissingError(f"{where}: nav.terrain: is missing; a fit needs known terrain (--config)")
        loaded = load_terrain(settings, lambda share: show("terrain", share), local_only=args.config is None)
        receiver = fit_receiver(
            device,
            loaded.terrain,
            samples,
            models=("nearest", "beam") if args.model == "auto" else (args.model,),
            count=args.samples,
            progress=lambda share: show("fit", share),
        )
    if args.json:
        print_json(_as_json(receiver, args), indent=2)
    else:
        print_lines(_as_text(receiver, args))
    if args.out is not None:
        write_output(args.out, as_toml(receiver, args.sensor, [str(session) for session in args.sessions]))
        print_line(args.out)
    if args.plot is not None:
        write_figure(lambda: draw_fit(receiver, args.sensor), args.plot)
    return 0


def check_output_path(out: Path) -> None:
    """Check before the long computation that a file can be written.  Raises ConfigError."""
    import os

    folder = next(parent for parent in out.absolute().parents if parent.exists())
    if out.is_dir() or not folder.is_dir():
        raise ConfigError(f"{out}: cannot be written: {'is a folder' if out.is_dir() else f'{folder} is not a folder'}")
    if not os.access(out if out.exists() else folder, os.W_OK):
        raise ConfigError(f"{out}: cannot be written: permission denied")


def _config_of(args: argparse.Namespace, session: Path) -> Config:
    from fti import config as configuration
    from fti.logger.reading.recording import Recording
    from fti.post.reprocess import recorded_setup

    return configuration.load(args.config) if args.config else recorded_setup(Recording.open(session), session).config


def _read(args: argparse.Namespace, progress: Any) -> tuple[Device, FitSamples]:
    """The device, which must be the same in all sessions, and the samples of all sessions."""
    from fti.config import Device
    from fti.hil.approach_reference.fit_samples import FitSamples, concatenate_samples, read_samples

    devices, parts = list[Device](), list[FitSamples]()
    for number, session in enumerate(args.sessions):
        where = args.config or session
        device = _config_of(args, session).find_device(args.sensor)
        if device is None or device.altimeter is None:
            raise ConfigError(f"{where}: device: no altimeter {args.sensor!r}; name one with --sensor")
        if devices and _mounting(device) != _mounting(devices[0]):
            raise ConfigError(
                f"{where}: device {args.sensor!r}: kind, lever arm or mounting differ from {args.sessions[0]}; "
                "a fit needs one altimeter in one mounting position"
            )
        devices.append(device)
        parts.append(read_samples(session, args.sensor, number))
        progress(number + 1)
    return devices[0], concatenate_samples(parts)


def _mounting(device: Device) -> tuple[object, ...]:
    assert device.altimeter is not None
    return device.altimeter.kind, device.lever_arm_b, device.rpy_bs_deg


def write_output(out: Path, text: str) -> None:
    """Write a file, and the folders above it.  Raises ConfigError."""
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{out}: cannot be written: {error.strerror}") from None


_DIGITS = {"beam_deg": 2, "threshold_db": 1, "bias_m": 2, "scale": 4}


def _as_text(receiver: FittedReceiver, args: argparse.Namespace) -> Iterator[str]:
    used, count = int(receiver.used.sum()), len(receiver.samples)
    yield (
        f"{args.sensor}: {used} of {count} samples used, of {receiver.available} in {len(args.sessions)} "
        f"session{'s' if len(args.sessions) > 1 else ''}; the others are outliers or have no prediction"
    )
    others = "; ".join(f"{model!r} {sd:.2f} m" for model, sd in receiver.others.items())
    scatter = f" (residual scatter {receiver.fit.sd:.2f} m; {others})" if others else ""
    yield f"  model         {receiver.model}{scatter}"
    for name, value, sd, configured in receiver.rows():
        digits = _DIGITS[name]
        default = "default" if configured is None else f"{configured:g}"
        remark = "; not observable on these flights, near its prior value" if name in receiver.fit.unobservable else ""
        yield f"  {name:12}  {value:.{digits}f} +- {sd:.{digits}f} (configured: {default}){remark}"
    before, after = receiver.rms()
    yield f"  residual      {before:.2f} m RMS as configured, {after:.2f} m as fitted"


def _as_json(receiver: FittedReceiver, args: argparse.Namespace) -> dict[str, Any]:
    before, after = receiver.rms()
    return {
        "sensor": args.sensor,
        "sessions": [str(session) for session in args.sessions],
        "model": receiver.model,
        "parameters": {
            name: {"value": value, "sd": sd, "configured": configured, "assumed": name in receiver.fit.unobservable}
            for name, value, sd, configured in receiver.rows()
        },
        "rms_before_m": before,
        "rms_after_m": after,
        "other_models": {model: {"scatter_m": sd} for model, sd in receiver.others.items()},
        "scatter_m": receiver.fit.sd,
        "samples": int(receiver.used.sum()),
        "samples_looked_at": len(receiver.samples),
        "samples_available": receiver.available,
    }
