"""Fit of the receiver of a device to recorded flights: its family, its parameters, and the file of its TOML table.

For a radar both families of ``[device.altimeter] model`` are fitted; the one with the lower cost is selected.  The TOML
table can be copied into a configuration.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fti import config as configuration
from fti.arrays import Array
from fti.config import Altimeter, Device
from fti.errors import ConfigError
from fti.hil.approach_reference.fit_samples import FitSamples
from fti.hil.approach_reference.range_tables import RangeTableBuilder
from fti.hil.approach_reference.receiver_fit import Problem, ReceiverFit, choose, coarse_start, refine
from fti.hil.approach_reference.receivers import ReceiverVariant
from fti.nav.integrity.reference import ReferenceSensor
from fti.terrain.terrain import Terrain

Model = Literal["nearest", "beam", "laser"]

#: Entries of the first table of nearest returns [deg]; step of the second one, number of steps to each side, and
#: maximum number of shifts while the best entry is on its edge.
NEAREST_DEG, FINE_DEG, FINE_ENTRIES, MOVES = tuple(range(5, 126, 5)), 1.0, 5, 4
#: Beam model: entries of the first table [deg]; step [deg] and half extents [deg], [dB] of the others.
BEAM_DEG, BEAM_STEPS = tuple(range(10, 111, 10)), ((2.5, 10.0, 22.0), (0.5, 2.0, 3.0))
#: Thresholds [dB] of the first tables, and step of the last one.
THRESHOLD_DB, FINE_DB = tuple(range(-24, -1)), 0.5
LIMITS_DEG, LIMITS_DB = (2.0, 150.0), (-25.0, -2.0)
#: Default threshold, a quarter of the peak.
QUARTER_DB = 10.0 * math.log10(0.25)
#: Minimum number of samples for a fit.
MIN_SAMPLES = 50


@dataclass(frozen=True, eq=False)
class FittedReceiver:
    """Result of a fit.

    model   : selected family; others : the other ones, with sigma of their residuals [m]
    configured_residuals : measured minus predicted with the configured receiver (n,) [m]; configured : its settings
    samples : used samples; available : number of all samples
    """

    model: Model
    fit: ReceiverFit
    others: dict[str, float]
    configured_residuals: Array
    configured: Altimeter
    samples: FitSamples
    available: int

    @property
    def used(self) -> NDArray[np.bool_]:
        """Mask of the samples that are not outliers and that both receivers predict."""
        return np.asarray(
            (self.fit.weights > 0.0) & np.isfinite(self.configured_residuals) & np.isfinite(self.fit.residuals)
        )

    def rms(self) -> tuple[float, float]:
        """RMS of the used residuals [m]: configured, fitted."""
        before, after = (
            float(np.sqrt(np.mean(e[self.used] ** 2))) for e in (self.configured_residuals, self.fit.residuals)
        )
        return before, after

    def rows(self) -> Iterator[tuple[str, float, float, float | None]]:
        """Name, value, one sigma, and the configured value of each parameter; beam and threshold first."""
        for name in (*self.fit.names[2:], *self.fit.names[:2]):
            yield name, self.fit[name], self.fit.sd_of(name), getattr(self.configured, name)


def fit_receiver(
    device: Device,
    terrain: Terrain,
    samples: FitSamples,
    *,
    models: Sequence[Model] = ("nearest", "beam"),
    count: int = 1000,
    progress: Callable[[float], None] = lambda _: None,
) -> FittedReceiver:
    """Fit the receiver of a radar, with one of the models; for a laser only bias and scale.

    count : maximum number of samples, evenly spread
    Raises ConfigError for too few samples, or without known terrain below them.
    """
    assert device.altimeter is not None
    some = samples.thin(count)
    if len(some) < MIN_SAMPLES:
        raise ConfigError(f"{device.name}: only {len(some)} samples with a position; a fit needs {MIN_SAMPLES}")
    families: Sequence[Model] = ("laser",) if device.altimeter.kind == "laser" else models
    receivers = RangeTableBuilder(device, terrain, some)
    bar = _ProgressCounter(progress, sum(_TABLES[model] for model in families))
    try:
        fits = {model: _fit(receivers, device.altimeter, model, bar) for model in families}
    except ValueError as error:
        raise ConfigError(f"{device.name}: {error}") from None
    sd = min(fit.sd for fit in fits.values())
    best = min(fits, key=lambda model: fits[model].cost(sd))
    others = {str(model): fit.sd for model, fit in fits.items() if model != best}
    configured_residuals = some.value - device.altimeter.scale * receivers.configured_ranges() - device.altimeter.bias_m
    progress(1.0)
    return FittedReceiver(best, fits[best], others, configured_residuals, device.altimeter, some, len(samples))


class _ProgressCounter:
    """Reports the share of the work, 1 at most: the number of shifted tables is not known in advance."""

    def __init__(self, progress: Callable[[float], None], total: int) -> None:
        self._progress, self._total, self._done = progress, total, 0

    def advance(self) -> None:
        """Count one table."""
        self._done += 1
        self._progress(min(self._done / self._total, 1.0))


def _fit(receivers: RangeTableBuilder, configured: Altimeter, model: Model, bar: _ProgressCounter) -> ReceiverFit:
    if model == "laser":
        problem = Problem(receivers.samples, receivers.laser(), np.array([0.0, 1.0]))
        return refine(problem, *coarse_start(problem))
    prior = np.array([0.0, 1.0, configured.beam_deg])
    if model == "nearest":
        return _fit_nearest(receivers, prior, bar)
    threshold = QUARTER_DB if configured.threshold_db is None else configured.threshold_db
    return _fit_beam(receivers, np.append(prior, threshold), bar)


def _fit_nearest(receivers: RangeTableBuilder, prior: Array, bar: _ProgressCounter) -> ReceiverFit:
    p, _ = coarse_start(Problem(receivers.samples, receivers.nearest(NEAREST_DEG, bar.advance), prior))
    for _ in range(MOVES):
        beams = _grid_around(p[2], FINE_DEG, FINE_DEG * FINE_ENTRIES, LIMITS_DEG)
        fine = Problem(receivers.samples, receivers.nearest(beams, bar.advance), prior)
        fit = refine(fine, *coarse_start(fine))
        p = fit.values
        if beams[0] < p[2] < beams[-1] or p[2] in LIMITS_DEG:
            break
    return fit


def _fit_beam(receivers: RangeTableBuilder, prior: Array, bar: _ProgressCounter) -> ReceiverFit:
    problems = [Problem(receivers.samples, receivers.beam(BEAM_DEG, THRESHOLD_DB, bar.advance), prior)]
    for step, half_deg, half_db in BEAM_STEPS:
        best = choose(problems)
        beams = _grid_around(best["beam_deg"], step, half_deg, LIMITS_DEG)
        thresholds: Sequence[float] = THRESHOLD_DB
        if half_db < -THRESHOLD_DB[0] + THRESHOLD_DB[-1]:
            thresholds = _grid_around(best["threshold_db"], FINE_DB, half_db, LIMITS_DB)
        problems.append(Problem(receivers.samples, receivers.beam(beams, thresholds, bar.advance), prior))
    return choose(problems)


def _grid_around(middle: float, step: float, half: float, limits: tuple[float, float]) -> list[float]:
    """Entries around a value, ascending, within limits."""
    entries = middle + np.arange(-half, half + 0.5 * step, step)
    return [float(entry) for entry in np.unique(np.clip(entries, *limits))]


#: Usual number of tables of one beam width per model.
_TABLES: dict[Model, int] = {"laser": 1, "nearest": len(NEAREST_DEG) + 2 * FINE_ENTRIES + 1, "beam": len(BEAM_DEG) + 18}


def as_toml(fitted_receiver: FittedReceiver, sensor: str, sessions: Sequence[str]) -> str:
    """The TOML table of the device, with its source as a comment."""
    before, after = fitted_receiver.rms()
    lines = [
        f"# The receiver of {sensor!r}, by fti reference fit from {int(fitted_receiver.used.sum())} samples of",
        *(f"#   {session!r}" for session in sessions),
        f"# Measured minus predicted: {before:.2f} m RMS as configured, {after:.2f} m as fitted.",
        "# Put these keys into [device.altimeter] of the device; +- is one sigma.",
        "",
        "[device.altimeter]",
    ]
    if fitted_receiver.model != "laser":
        lines.append(f'model = "{fitted_receiver.model}"')
    for name, value, sd, _ in fitted_receiver.rows():
        note = ", not observable: close to the assumed value" if name in fitted_receiver.fit.unobservable else ""
        lines.append(f"{name} = {value:.{_DIGITS[name]}f}  # +- {sd:.{_DIGITS[name]}f}{note}")
    return "\n".join(lines) + "\n"


_DIGITS = {"beam_deg": 2, "threshold_db": 2, "bias_m": 2, "scale": 5}


# ---------------------------------------------------------------------------------------------------------------- file


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


def make_receiver(sensor: ReferenceSensor, keys: FittedKeys) -> ReceiverVariant:
    """The fitted receiver; without a fitted beam it has the stated one."""
    beam = math.radians(sensor.beam_deg if keys.beam_deg is None else keys.beam_deg)
    if sensor.kind == "laser":
        return ReceiverVariant("laser", 0.0, bias=keys.bias_m, scale=keys.scale)
    if keys.model == "nearest":
        return ReceiverVariant("nearest", beam, 0.0, bias=keys.bias_m, scale=keys.scale)
    threshold = 0.25 if keys.threshold_db is None else 10.0 ** (keys.threshold_db / 10.0)
    return ReceiverVariant("cosine", beam, threshold, bias=keys.bias_m, scale=keys.scale)
