"""The smallest ramps and accelerations that the ladder of copies detects, by the age of replacement of the oldest copy.

    python -m fti.study.faults.curve [FILE.png]

A fault of position and velocity moves the filter by m(t); a copy that began before the onset does not move.  Copies are
renewed every quarter of the age T, so that a copy of an age of at most t + T/4 includes the whole fault.  It suspects
the fault at k_fa = 4.2 sigma of d, and misses it with 1e-3 where it is k_md = 3.09 sigma larger:

    smallest(T) = 7.29 / max over t <= 3T/4, position and velocity, of |m(t)| / sigma_d(t + T/4)     m : of a fault of 1

sigma_d : ``detectability.separation_sds``;  m : ``detectability.filter_response``.  A fault below the curve at the age
of the oldest copy is not detected, and is not in the protection level.  Measurements once a second, one receiver.
Checked against: tests/study/test_faults_curve.py.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from fti.arrays import Array
from fti.nav.separation.monitor import K_FA_SATELLITES
from fti.plot_style import label_axes, new_figure, write_figure
from fti.study.faults import detectability

GRADES = ("navigation", "tactical", "mems")
#: Maximum age of the oldest copy [s].
MAX_AGE_S = 160
#: Copies of a ring, replaced in turn.
RENEWALS = 4


class Curve(NamedTuple):
    """ages [s], ramp [m/s] and acceleration [m/s^2] that are just detected with a copy of that age, each shape (n,)."""

    ages: Array
    ramp: Array
    acceleration: Array


def smallest(grade: str) -> Curve:
    """Curve of a grade of inertial unit with one receiver."""
    t = np.arange(MAX_AGE_S + 1.0)
    sds = detectability.separation_sds(grade, MAX_AGE_S)
    ramp = detectability.filter_response(grade, np.stack((t, np.ones_like(t)), axis=1))
    acceleration = detectability.filter_response(grade, np.stack((0.5 * t**2, t), axis=1))
    ages = np.arange(RENEWALS, MAX_AGE_S + 1, RENEWALS)
    found = np.array(
        [[smallest_detected(response, sds, int(age)) for response in (ramp, acceleration)] for age in ages]
    )
    return Curve(ages.astype(np.float64), found[:, 0], found[:, 1])


def smallest_detected(response: Array, sds: Array, age_s: int) -> float:
    """Smallest fault that copies with a replacement age detect; infinite without detection.

    response : of the filter to a fault of size 1 at 0, 1, ... s, shape (n, 2);  sds : of d at 1, 2, ... s, shape (m, 2)
    """
    step = age_s // RENEWALS
    t = np.arange(1, age_s - step + 1)
    largest = float(np.max(np.abs(response[t]) / sds[t + step - 1], initial=0.0))
    return (K_FA_SATELLITES + detectability.K_MD) / largest if largest > 0.0 else np.inf


def table() -> str:
    """Smallest faults at the configured age of the oldest copy, their error by then, and HPL without a fault."""
    titles = ("unit", "oldest copy [s]", "ramp [m/s]", "error by then [m]", "acceleration [m/s^2]", "error by then [m]")
    rows = [f"| {' | '.join((*titles, 'HPL [sigma]'))} |", "|---|---|---|---|---|---|---|"]
    rows += [_row(grade, grade, detectability.AGE_S[grade]) for grade in GRADES]
    rows += [
        _row(f"{grade}, all of several receivers", grade, detectability.AGE_OF_SEVERAL_S[grade]) for grade in GRADES
    ]
    return "\n".join(rows)


def _row(title: str, grade: str, age: int) -> str:
    found, at = smallest(grade), age // RENEWALS - 1
    ramp, acceleration = float(found.ramp[at]), float(found.acceleration[at])
    errors = ramp * age, 0.5 * acceleration * age**2
    level = detectability.level_ratio(grade, age)
    return f"| {title} | {age} | {ramp:.2f} | {errors[0]:.0f} | {acceleration:.3f} | {errors[1]:.0f} | {level:.1f} |"


def draw() -> Figure:
    """Both curves of each grade; a mark at the configured age."""
    figure = new_figure(
        "Smallest detected faults", "of one receiver; marks: configured age of the oldest copy", height=4.0
    )
    axes = figure.subplots(1, 2)
    for grade in GRADES:
        curve, at = smallest(grade), detectability.AGE_S[grade] // RENEWALS - 1
        for axis, values in zip(axes, (curve.ramp, curve.acceleration), strict=True):
            (line,) = axis.loglog(curve.ages, values, label=grade)
            axis.plot(curve.ages[at], values[at], "o", color=line.get_color())
    for axis, quantity in zip(axes, ("ramp of the position [m/s]", "acceleration [m/s\u00b2]"), strict=True):
        label_axes(axis, "age of the oldest copy [s]", quantity)
    axes[0].legend()
    return figure


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; plot the curves into a new file, if it is given."""
    args = sys.argv[1:] if argv is None else argv
    sys.stdout.write(table() + "\n")
    if args:
        write_figure(draw, Path(args[0]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
