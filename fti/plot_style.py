"""Common style of all figures of studies, flights and terrain; drawn without a display.

Colours are those of Okabe and Ito (Color Universal Design, 2008), distinguishable with any colour vision; each
sensor has the same colour in every figure.  Images use ``cividis`` (uniform in lightness).  Lengths are in metres.
"""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fti.new_file import write_new_file

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#8C8C8C"
GROUND, CANOPY = "#B8A68C", "#7FA77A"

DOTS_PER_INCH = 120
#: Metadata that are left out by file format, so that the same figure gives an identical file.
_METADATA: dict[str, dict[str, Any]] = {".png": {"Software": None}, ".svg": {"Date": None}}
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "figure.titlesize": 12.0,
    "figure.dpi": DOTS_PER_INCH,
    "savefig.dpi": DOTS_PER_INCH,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "none",
    "legend.fontsize": 8.5,
    "image.cmap": "cividis",
    "path.simplify_threshold": 0.2,
    "svg.hashsalt": "fti",
}


def new_figure(title: str, subtitle: str = "", *, width: float = 9.0, height: float = 6.0) -> Figure:
    """An empty figure [inch] with a title; the subtitle, in small type, states the conditions."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    text = f"{title}\n" if subtitle else title
    figure.suptitle(text, x=0.012, ha="left", fontweight="bold")
    if subtitle:
        figure.text(0.012, 1.0 - 0.40 / height, subtitle, ha="left", va="center", fontsize=9.0, color="#444444")
    return figure


def label_axes(axes: Axes, x: str = "", y: str = "", title: str = "") -> None:
    """Set the labels of the axes, each with its unit, and the title of the panel."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title)


def add_legend(axes: Axes) -> None:
    """Add a legend in one line above the axes."""
    handles, _ = axes.get_legend_handles_labels()
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.98), borderaxespad=0.1, ncols=len(handles), frameon=False
    )  # fmt: skip


def write_figure(draw: Callable[[], Figure], file: Path) -> None:
    """Draw a figure in the common style into a new file, .png or .svg.  Raises StorageError; what ``draw`` raises."""
    picture = BytesIO()
    with mpl.rc_context(STYLE):
        draw().savefig(picture, format=file.suffix[1:], metadata=_METADATA[file.suffix])
    write_new_file(file, picture.getvalue())
