"""Reading of the file of ``fti reference fit``, and the receiver that it describes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from fti import config as configuration
from fti.errors import ConfigError
from fti.hil.approach_reference.receivers import ReceiverVariant
from fti.nav.integrity.reference import ReferenceSensor


class FittedKeys(configuration.StrictModel):
    """``[device.altimeter]`` of the file: the fitted keys, with the meaning of the configuration."""

    model: Literal["nearest", "beam"] = "nearest"
    beam_deg: Annotated[float, Field(gt=0, lt=180)] | None = None
    threshold_db: Annotated[float, Field(ge=-26, le=-2)] | None = None
    bias_m: Annotated[float, Field(ge=-100, le=100)] = 0.0
    scale: Annotated[float, Field(ge=0.8, le=1.25)] = 1.0


def read_fitted(file: Path) -> FittedKeys:
    """The keys in a file.  Raises MissingError; ConfigError if the table is missing, or has other keys."""
    table, _ = configuration.read_toml(file)
    keys: Any = table.get("device")
    keys = keys.get("altimeter") if isinstance(keys, dict) else None
    if not isinstance(keys, dict):
        raise ConfigError(f"{file}: device.altimeter: is missing; fti reference fit --out writes it")
    return configuration.bind(FittedKeys, keys, str(file), "device.altimeter")


def fitted_receiver(sensor: ReferenceSensor, keys: FittedKeys) -> ReceiverVariant:
    """The fitted receiver; without a fitted beam it has the stated one."""
    beam = math.radians(sensor.beam_deg if keys.beam_deg is None else keys.beam_deg)
    if sensor.kind == "laser":
        return ReceiverVariant("laser", 0.0, bias=keys.bias_m, scale=keys.scale)
    if keys.model == "nearest":
        return ReceiverVariant("nearest", beam, 0.0, bias=keys.bias_m, scale=keys.scale)
    threshold = 0.25 if keys.threshold_db is None else 10.0 ** (keys.threshold_db / 10.0)
    return ReceiverVariant("cosine", beam, threshold, bias=keys.bias_m, scale=keys.scale)
