"""Fault detection: valid solutions must be within their protection level, for any fault of a source.

Simulated flights of an hour (four grades of inertial unit, one or two receivers, legs or turns, ten terrains) go
through the product at the level of measurements (``product``).  Some twelve faults branch off each of them
(``experiment``).  Cells of the table of detectable faults, which is computed beforehand (``detectability``,
decision 42), are judged, others are reported:

    misleading (MI)   valid, and the error beyond the protection level: pooled at most 1e-3 of fault time (95 % bound,
                      bootstrap over flights), no cell above 1 %
    hazardous (HMI)   valid, and the error beyond the alert limit (200 m, 30 m): never
    nominal           at most 2 false exclusions in 300 h; tactical unit, one receiver, from 10 min on: valid in 99.5 %;
                      HPL at most 6.5 sigma in the median with two receivers, 12 with one; 1.2 times that at d = 0

The comparison is fair: the simulator (``cells``, ``flight`` and their imports) shares no sensor model with the product;
its errors are drawn from grades of the literature and not from assumptions of the product.
Source: docs/fault-detection.md; Groves 2013 for units and receivers; Willsky, Jones 1976 for the table.

    from fti.study.faults import CELLS, draw

    for t_ns, device, measurement in draw(CELLS[0], seed=1):
        ...

``Cell`` defines fault, magnitude and inertial unit; ``SimulatedFlight`` iterates over the measurements of all devices
in order of time, and has the truth (``truth``, ``error``) and the fault (``fault``).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fti.parallel_runs import Progress, run_all
from fti.study import DrawFigure, StudyResult
from fti.study.faults.cells import CELLS, Cell, SensorFault
from fti.study.faults.flight import START_NS, FlightFault, SimulatedFlight, draw

if TYPE_CHECKING:
    from fti.study.faults.experiment import TaskOutcome

__all__ = ["CELLS", "START_NS", "Cell", "FlightFault", "SensorFault", "SimulatedFlight", "draw"]

#: Faults of each cell of the table: 3,168 of them, and 300 nominal hours with those of others.
RUNS = 11
SEED = 17
#: Outcomes of the last study, by seed, for its plots.
_outcomes: dict[int, list[TaskOutcome]] = {}


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` faults of each cell of the table, an eleventh of that of others."""
    from fti.study.faults.experiment import fly, plan  # the simulator alone needs no navigation
    from fti.study.faults.judge import judge_all

    _outcomes[seed] = run_all(fly, plan(runs, seed), progress)
    return judge_all(_outcomes[seed], np.random.default_rng([seed, 3]))


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Error and levels of a ramp, by grade; MI of all cells of the study."""
    from fti.study.faults import judge, plots

    return {"ramp": lambda: plots.ramp(seed), "cells": lambda: plots.cells(_outcomes[seed], judge.CELL)}
