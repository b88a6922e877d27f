"""The altimeter of ``fti reference make``, from its arguments or from the daemon's configuration."""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING

from fti.cli._printing import print_line
from fti.errors import ConfigError

if TYPE_CHECKING:
    from fti.config import Config, Device
    from fti.hil.approach_reference.approaches import AltimeterModel
    from fti.nav.integrity.reference import ApproachReference

#: The model of each kind of altimeter.
KINDS = {"radar": "ra4500", "laser": "laser"}


def load(path: Path | None) -> Config | None:
    """The daemon's configuration, if there is one.  Raises ConfigError, MissingError."""
    from fti.config.loading import load as load_config

    return None if path is None else load_config(path)


def model_of(args: argparse.Namespace, config: Config | None) -> AltimeterModel:
    """The model of the altimeter: from the arguments, else from the configuration, else an RA-4500 with 40 deg.

    Raises ConfigError for a configuration without an altimeter.
    """
    from fti.hil.approach_reference.approaches import MODELS

    device = None if config is None else _altimeter(config, args.sensor)
    limits = device.altimeter if device else None
    model = MODELS[args.altimeter or KINDS[limits.kind if limits else "radar"]]
    if model.sensor.kind == "laser":
        return model
    beam = args.beam or (limits.beam_deg if limits else model.sensor.beam_deg)
    return dataclasses.replace(model, sensor=model.sensor.model_copy(update={"beam_deg": beam}))


def _altimeter(config: Config, name: str) -> Device:
    names = ([name] if name in config.nav.altimeters else []) + list(config.nav.altimeters)
    devices = [device for name in names if (device := config.find_device(name)) and device.altimeter]
    if not devices:
        raise ConfigError(f"{config.path}: nav.altimeters: no device in it has [device.altimeter]; one is required")
    return devices[0]


def check_alert_limit(reference: ApproachReference, config: Config | None, out: Path) -> None:
    """Print the minimum protection level.  Raises ConfigError when the configuration's alert limit is smaller."""
    from fti.nav.integrity.reference import check_alert_limit as check
    from fti.nav.integrity.reference import min_level_v

    level = min_level_v(reference)
    print_line(
        f"minimum vertical protection level {level:.1f} m: nav.approach.alert_v_m must be at least {math.ceil(level)}"
    )
    if config is not None and config.nav.approach is not None:
        check(reference, config.nav.approach.alert_v_m, str(out), str(config.path))
