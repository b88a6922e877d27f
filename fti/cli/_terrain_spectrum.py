"""Spectrum of a terrain as text, as JSON, and as a plot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from fti.plot_style import BLACK, BLUE, VERMILION, add_legend, label_axes, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fti.terrain.spectrum import Spectrum

KINDS = ("heights", "slopes")


def as_json(spectrum: Spectrum, share: float, speed_mps: float) -> dict[str, Any]:
    """Everything that ``as_text`` prints; None where the ground is a plane, or the area too small."""
    below = {kind: spectrum.frequency_below(share, of_slopes=kind == "slopes") for kind in KINDS}
    return {
        "cell_m": spectrum.cell_m,
        "posts": list(spectrum.posts),
        "share": share,
        "speed_mps": speed_mps,
        "heights_sd_m": math.sqrt(spectrum.height_power.sum()),
        "slopes_sd": math.sqrt(spectrum.slope_power.sum()),
        "frequency_per_m": below,
        "required_rate_hz": {kind: found and 2.0 * found * speed_mps for kind, found in below.items()},
        "max_useful_rate_hz": speed_mps / spectrum.cell_m,
        "correlation_m": spectrum.correlation_m,
    }


def as_text(found: dict[str, Any]) -> Iterator[str]:
    """Lines for people."""
    speed, rate = f"{found['speed_mps']:g} m/s", found["max_useful_rate_hz"]
    rows, columns = found["posts"]
    posts = f"{rows} x {columns}, {found['cell_m']:g} m apart"
    yield f"posts        {posts}: at {speed} more than {rate:.2f} Hz are useless"
    yield f"sd           heights {found['heights_sd_m']:.2f} m, slopes {found['slopes_sd']:.3f}"
    for kind, frequency in found["frequency_per_m"].items():
        if frequency is None:
            yield f"{kind:12} the ground is a plane"
        else:
            waves = f"waves of {1.0 / frequency:.0f} m and longer have {100.0 * found['share']:g} % of the variance"
            yield f"{kind:12} {waves}; they need {found['required_rate_hz'][kind]:.2f} Hz at {speed}"
    length = found["correlation_m"]
    yield "correlation  " + (
        "none within half of the area" if length is None else f"{length:.0f} m to 1/e of the autocorrelation"
    )


def draw_spectrum(spectrum: Spectrum, share: float) -> Figure:
    """Power of heights and slopes by frequency, and their cumulative shares."""
    figure = new_figure(
        "Spectrum of the terrain",
        f"Power of all directions in rings of the frequency. Dotted: {100.0 * share:g} % of the variance.",
        width=10.0,
        height=4.8,
    )
    density, cumulative = figure.subplots(1, 2)
    per_km = 1e3 * spectrum.frequency
    lines = (("heights", spectrum.height_power, BLUE, "-"), ("slopes", spectrum.slope_power, VERMILION, "--"))
    for name, power, colour, style in lines:
        total = power.sum() or 1.0
        density.loglog(per_km, np.where(power > 0.0, power / total, np.nan), style, color=colour, label=name)
        cumulative.semilogx(per_km, np.cumsum(power) / total, style, color=colour, label=name)
    cumulative.axhline(share, color=BLACK, linestyle=":")
    label_axes(density, "frequency [1/km]", "share of the variance")
    label_axes(cumulative, "frequency [1/km]", "share of the variance below")
    density.set_ylim(bottom=1e-8)
    for axes in (density, cumulative):
        add_legend(axes)
    return figure
