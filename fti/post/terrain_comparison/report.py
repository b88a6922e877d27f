"""The comparison as text and as JSON."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from fti.post.score.outputs.table import text_table
from fti.post.terrain_comparison.observer import ComparedFlight, MethodFix
from fti.post.terrain_comparison.statistics import FlightResult, MethodRow

HEAD = (
    "method", "profiles", "valid", "median", "p95", "sigma", "error/sigma", "in 95 %", "wrong", "error/bound",
    "cpu", "filter", "refused",
)  # fmt: skip
#: Explains the columns; each line is printed.
LEGEND = (
    "horizontal errors of valid fixes [m]; sigma: stated, of fix and map; error/sigma: 1 is right; in 95 %: ellipse",
    "wrong: beyond 99.9 % of the ellipse and 30 m; error/bound: Cramer-Rao bound of the profile with map and reference",
    "cpu: of one profile [s]; filter: RMS error [m] of the filter without satellites with the fixes of this method",
)


def as_text(result: FlightResult) -> list[str]:
    """Lines: the reference, one row for each method, and the filter without satellites."""
    of_reference = "" if result.reference_sd == 0.0 else f", sigma {_m(result.reference_sd)}"
    first = f"reference: {result.reference}{of_reference}"
    lines = [first, "", *text_table([HEAD, *map(_cells, result.methods)]), "", *LEGEND, ""]
    if not result.seconds:
        return [*lines, "inertial alone / filter / bound: there was no reference position after the first profile"]
    numbers = " / ".join(map(_m, result.totals))
    seconds = f"RMS over {result.seconds} s without satellites"
    return [*lines, f"inertial alone / filter ({result.in_flight}) / bound: {numbers}, {seconds}"]


def _cells(row: MethodRow) -> tuple[str, ...]:
    numbers = (row.median_m, row.p95_m, row.sd_m)
    refused = ", ".join(f"{count} {reason}" for reason, count in row.refused.items())
    return (
        row.method,
        str(row.profiles),
        str(row.valid),
        *map(_number, numbers),
        _number(row.error_over_sd),
        "-" if math.isnan(row.inside) else f"{row.inside:.0%}",
        str(row.wrong),
        _number(row.error_over_bound),
        _number(row.cpu_s),
        _number(row.filter_m),
        refused,
    )


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def _m(value: float) -> str:
    return f"{value:.1f} m"


def as_json(result: FlightResult, flight: ComparedFlight) -> dict[str, Any]:
    """All numbers, and every fix; unknown numbers are null."""
    table = asdict(result)
    for row in table["methods"]:
        row["fixes"] = [_fix(each) for each in flight.fixes[row["method"]]]
    table["bounds_m"] = flight.bounds
    known: dict[str, Any] = without_nan(table)
    return known


def _fix(each: MethodFix) -> dict[str, Any]:
    fix = each.fix
    return {
        "t_valid_ns": fix.t_valid_ns,
        "valid": fix.valid,
        "reasons": [str(reason) for reason in fix.reasons],
        "lat": fix.lat,
        "lon": fix.lon,
        "north_sd": fix.north_sd,
        "east_sd": fix.east_sd,
        "correlation": fix.correlation,
        "error_north": None if each.error is None else float(each.error[0]),
        "error_east": None if each.error is None else float(each.error[1]),
        "cpu_s": each.seconds,
    }


def without_nan(value: Any) -> Any:
    """Tables and lists with None for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: without_nan(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
