"""Pictures of the study of fault detection: one ramp through the product, and misleading solutions by cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from fti.plot_style import BLUE, GREY, ORANGE, VERMILION, add_legend, label_axes, new_figure
from fti.study.faults import experiment
from fti.study.faults.cells import CELLS, SHARP, Cell, SensorFault
from fti.study.faults.detectability import is_detectable
from fti.study.faults.product import LIMITS, Product, SolutionRecord, errors_n

GRADES = ("navigation", "tactical")
ONSET_S, RATE_M_S = 420.0, 1.0
#: Position of a zero share on the logarithmic axis.
NONE = 1e-4


def ramp(seed: int) -> Figure:
    """Error and protection level of a ramp of position and velocity, by grade."""
    figure = new_figure(
        f"Error and protection level when a receiver drifts off by {RATE_M_S:g} m/s",
        "Position and velocity, at once; one receiver. Shaded: the fault. Dots: a source is refused.",
        height=7.0,
    )
    for axes, grade in zip(figure.subplots(len(GRADES), 1, sharex=True), GRADES, strict=True):
        cell = Cell(grade, SensorFault.RAMP, RATE_M_S, SHARP, with_velocity=True)
        record, error = _through(seed, cell)
        t = record["t"]
        axes.axvspan(ONSET_S, ONSET_S + 300.0, color=GREY, alpha=0.18, lw=0.0)
        axes.axhline(LIMITS.position_m, color=GREY, lw=0.8, ls="--", label="alert limit")
        axes.plot(t, record["hpl"], color=ORANGE, label="HPL")
        axes.plot(t, error, color=BLUE, label="error")
        refused = record["is_refused"] > 0.0
        axes.plot(t[refused], error[refused], ".", color=VERMILION, ms=3.0)
        axes.set_yscale("log")
        label_axes(axes, x="time [s]" if grade == GRADES[-1] else "", y="horizontal [m]", title=grade)
        add_legend(axes)
    return figure


def _through(seed: int, cell: Cell) -> tuple[SolutionRecord, np.ndarray]:
    """Solutions of a nominal flight up to the fault and through it, and their horizontal error."""
    task = experiment.FlightTask(seed, 0, experiment.AircraftGroup.of(cell), (), ONSET_S)
    nominal, product = experiment.nominal_flight(task), Product(cell)
    before = product.fly(nominal.between(0.0, ONSET_S))
    flight, after = experiment.strike_through(product, nominal, cell, ONSET_S, task)
    record = SolutionRecord(
        np.concatenate((before.rows, after.rows)), (*before.events, *after.events), after.calibration
    )
    errors = errors_n(flight, record.rows)
    return record, np.hypot(errors[:, 0], errors[:, 1])


def cells(found: Sequence[experiment.TaskOutcome], limit: float) -> Figure:
    """MI of every cell, legs and turns together; cells of the table are marked.  limit : of each [1]"""
    merged = dict[Cell, list[experiment.FaultOutcome]]()
    for fault in (fault for task in found for fault in task.faults):
        merged.setdefault(replace(CELLS[fault.cell], pattern="legs"), []).append(fault)
    kinds = sorted({_kind(cell) for cell in merged}, reverse=True)
    figure = new_figure(
        "Valid and beyond a protection level: share of fault time, by cell",
        f"{sum(map(len, merged.values()))} faults. Full: cells of the table, at most {limit:g} each. Hollow: others.",
        height=9.0,
    )
    axes = figure.subplots()
    for cell, faults in merged.items():
        colour = BLUE if is_detectable(cell) else GREY
        axes.plot(
            max(NONE, experiment.share(faults)), kinds.index(_kind(cell)), "o", ms=6.0, color=colour, alpha=0.7,
            mfc=colour if is_detectable(cell) else "none",
        )  # fmt: skip
    axes.axvline(limit, color=VERMILION, lw=0.9)
    axes.set_xscale("log")
    axes.set_yticks(range(len(kinds)), kinds)
    label_axes(axes, x=f"share of fault time (none: {NONE:g})")
    return figure


def _kind(cell: Cell) -> str:
    """Fault and magnitude, without grade and number of receivers."""
    return cell.name.split("/")[1]
