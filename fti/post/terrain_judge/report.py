"""The result as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fti.post.score.outputs.table import text_table
from fti.post.terrain_comparison.report import without_nan
from fti.post.terrain_judge.fit import BIAS, EAST, LAG, NORTH, MapFit
from fti.post.terrain_judge.judge import AltimeterResult, CoverRow, MapDifference, MapResult
from fti.post.terrain_judge.session import SessionResult

HEAD = ("map", "covered", "fit", "bias [m]", "east [m]", "north [m]", "lag [ms]", "spread [m]")
COVER_HEAD = ("map", "class", "ranges", "bias [m]", "spread [m]")
#: Explains the columns; each line is printed.
LEGEND = (
    "bias: measured ground minus map, of altimeter, navigated altitude, datum and map together",
    "east, north: place of the map relative to the position source; lag: of the altimeter, in addition to latency_ms",
    "spread: robust sigma of the residuals; +-: 1 sigma by a bootstrap of blocks and ground squares; -: fixed to 0",
)
AS_GIVEN, WITH_SHIFT = "as given", "with shift"
PARAMETERS = ("bias_m", "shift_east_m", "shift_north_m", "lag_s")


def as_text(result: SessionResult) -> Iterator[str]:
    """A table and the comparisons of each altimeter."""
    for altimeter in result.altimeters:
        samples = altimeter.samples
        beam = "wide beam, nearest return" if samples.half_beam else "narrow beam"
        yield (
            f"{altimeter.sensor}: {len(samples)} ranges ({beam}), {samples.length_m / 1000:.1f} km in "
            f"{samples.block_count} blocks; position source: {', '.join(result.position_sources)}"
        )
        yield ""
        yield from text_table([HEAD, *(row for each in altimeter.maps for row in _rows(each))])
        yield ""
        for each in altimeter.maps:
            if each.refusals:
                yield f"{each.name}: shift or lag, not both: {'; '.join(each.refusals)}"
        yield from _difference_lines(altimeter)
        if altimeter.cover:
            yield ""
            yield from text_table([COVER_HEAD, *map(_cover_cells, altimeter.cover)])
        yield ""
    yield from LEGEND


def _rows(result: MapResult) -> Iterator[tuple[str, ...]]:
    """The fit without a shift, and that with it."""
    yield (result.name, f"{result.covered:.0%}", AS_GIVEN, *_cells(result.as_given))
    yield ("", "", WITH_SHIFT, *_cells(result.best))


def _cells(fit: MapFit) -> tuple[str, ...]:
    values = (
        _with_sd(fit, BIAS, 1.0, 2),
        _with_sd(fit, EAST, 1.0, 1),
        _with_sd(fit, NORTH, 1.0, 1),
        _with_sd(fit, LAG, 1000.0, 0),
    )
    return (*values, f"{fit.spread_m:.2f}")


def _with_sd(fit: MapFit, parameter: int, scale: float, digits: int) -> str:
    if parameter not in fit.free:
        return "-"
    value, sd = scale * float(fit.values[parameter]), scale * float(fit.sds[parameter])
    return f"{value:+.{digits}f} +- {sd:.{digits}f}"


def _cover_cells(row: CoverRow) -> tuple[str, ...]:
    return row.name, str(row.land_cover), str(row.samples), f"{row.bias_m:+.2f}", f"{row.spread_m:.2f}"


def _difference_lines(altimeter: AltimeterResult) -> Iterator[str]:
    pairs = zip(altimeter.differences, altimeter.shifted_differences, strict=True)
    for given, shifted in pairs:
        yield f"{AS_GIVEN}: {_difference(given)}"
        yield f"{WITH_SHIFT}: {_difference(shifted)}"


def _difference(pair: MapDifference) -> str:
    numbers = (
        f"mean square residuals differ by {abs(pair.square_m2):.3g} m^2, 95 % interval {pair.low:.3g} to "
        f"{pair.high:.3g}, {pair.samples} common ranges"
    )
    if pair.better is None:
        return f"no difference is proven between {pair.first} and {pair.second}: {numbers}"
    other = pair.second if pair.better == pair.first else pair.first
    return f"{pair.better} agrees better than {other}: {numbers}"


def as_json(result: SessionResult) -> dict[str, Any]:
    """All numbers; unknown numbers are null."""
    table = {
        "position_sources": list(result.position_sources),
        "altimeters": [_altimeter(each) for each in result.altimeters],
    }
    known: dict[str, Any] = without_nan(table)
    return known


def _altimeter(result: AltimeterResult) -> dict[str, Any]:
    return {
        "sensor": result.sensor,
        "ranges": len(result.samples),
        "blocks": result.samples.block_count,
        "length_m": result.samples.length_m,
        "wide_beam": result.samples.half_beam > 0.0,
        "maps": [_map(each) for each in result.maps],
        "differences": {
            "as_given": [_pair(each) for each in result.differences],
            "with_shift": [_pair(each) for each in result.shifted_differences],
        },
        "land_cover": [
            {"map": row.name, "class": row.land_cover, "ranges": row.samples, "bias_m": row.bias_m,
             "spread_m": row.spread_m}
            for row in result.cover
        ],
    }  # fmt: skip


def _map(result: MapResult) -> dict[str, Any]:
    return {
        "map": result.name,
        "covered": result.covered,
        "shift_or_lag_only": list(result.refusals),
        "as_given": _fit(result.as_given),
        "with_shift": _fit(result.best),
    }


def _fit(fit: MapFit) -> dict[str, Any]:
    """Values, the covariance in their order; a parameter that is fixed to 0 is not in ``estimated``."""
    return {
        "estimated": [PARAMETERS[parameter] for parameter in fit.free],
        **{name: float(value) for name, value in zip(PARAMETERS, fit.values, strict=True)},
        "covariance": fit.cov.tolist(),
        "spread_m": fit.spread_m,
    }


def _pair(pair: MapDifference) -> dict[str, Any]:
    return {
        "first": pair.first,
        "second": pair.second,
        "mean_square_m2": pair.square_m2,
        "interval_m2": [pair.low, pair.high],
        "common_ranges": pair.samples,
        "better": pair.better,
    }
