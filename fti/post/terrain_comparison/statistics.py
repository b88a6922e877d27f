"""One row for each method: how often it has a fix, how good that is, and what it costs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.nav.terrain_methods import METHODS
from fti.post.terrain_comparison.observer import ALONE, BOUND, ComparedFlight, FilterSample, MethodFix

#: Chi-square of two dimensions: 95 % and 99.9 %.
INSIDE_2, WRONG_2 = 5.991, 13.8
#: A fix is wrong beyond 99.9 % of its ellipse and this distance [m], as in ``fti study matching``.
WRONG_M = 30.0


@dataclass(frozen=True, slots=True)
class MethodRow:
    """A method on one flight; numbers without fixes are NaN.

    profiles, valid : number of profiles, and of fixes that aid the filter
    refused   : number of the other profiles by their first reason
    compared  : valid fixes where the reference is known; all that follows is of these
    median_m, p95_m : of the horizontal error
    sd_m      : median of the stated sigma, both axes together, of fix and map
    error_over_sd : RMS of the error over sigma of fix, map and reference, for each axis; 1 is right
    inside    : share of errors within the 95 % ellipse;  wrong : fixes beyond 99.9 % of it and 30 m
    error_over_bound : RMS of the error over the Cramer-Rao bound of its profile, with the sigmas of map and reference
    cpu_s     : median of the processor time of a profile
    filter_m  : RMS error of the filter without satellites that this method alone aids
    """

    method: str
    about: str
    profiles: int
    valid: int
    refused: dict[str, int]
    compared: int
    median_m: float
    p95_m: float
    sd_m: float
    error_over_sd: float
    inside: float
    wrong: int
    error_over_bound: float
    cpu_s: float
    filter_m: float


@dataclass(frozen=True, slots=True)
class FlightResult:
    """All methods, and the filter without satellites from the first profile on.

    in_flight : name of the method that aids the filter in flight
    reference, reference_sd : its name, and the median of its sigma, both axes together [m]
    seconds  : in which the filters were compared
    alone_m  : RMS error of the filter without satellites and fixes
    bound_m  : RMS of the Cramer-Rao bound of a filter with fixes, both axes together
    profile_bound_m : median bound of one profile
    """

    in_flight: str
    reference: str
    reference_sd: float
    seconds: int
    alone_m: float
    bound_m: float
    profile_bound_m: float
    methods: tuple[MethodRow, ...]

    @property
    def totals(self) -> tuple[float, float, float]:
        """Inertial alone, filter with the method in flight, bound [m]."""
        (row,) = (row for row in self.methods if row.method == self.in_flight)
        return self.alone_m, row.filter_m, self.bound_m


def summarise(flight: ComparedFlight) -> FlightResult:
    """Rows and totals of a flight."""
    known = [bound for bound in flight.bounds if math.isfinite(bound)]
    return FlightResult(
        in_flight=flight.in_flight,
        reference=flight.reference,
        reference_sd=_median([math.sqrt(np.trace(position.cov)) for _, position in flight.track]),
        seconds=len(flight.outage_ns),
        alone_m=_rms([float(np.hypot(*sample.error)) for sample in flight.filters[ALONE]]),
        bound_m=_rms([sample.sd for sample in flight.filters[BOUND]]),
        profile_bound_m=_median(known),
        methods=tuple(
            method_row(name, fixes, flight.bounds, flight.filters[name], flight.map_sd)
            for name, fixes in flight.fixes.items()
        ),
    )


def method_row(
    name: str, fixes: Sequence[MethodFix], bounds: Sequence[float], filtered: Sequence[FilterSample], map_sd: float
) -> MethodRow:
    """The row of a method.  bounds : of the profiles [m];  filtered : the filter that it aids;  map_sd : [m]"""
    compared = [
        (each, each.error, bound)
        for each, bound in zip(fixes, bounds, strict=True)
        if each.fix.valid and each.error is not None
    ]
    errors = [float(np.hypot(*error)) for _, error, _ in compared]
    squares = [float(error @ np.linalg.solve(total_cov(each, map_sd), error)) for each, error, _ in compared]
    over_bound = [
        error / math.hypot(bound_with_map(bound, map_sd), _reference_sd(each))
        for error, (each, _, bound) in zip(errors, compared, strict=True)
        if bound > 0.0
    ]
    return MethodRow(
        method=name,
        about=METHODS[name].about,
        profiles=len(fixes),
        valid=sum(each.fix.valid for each in fixes),
        refused=dict(Counter(str(each.fix.reasons[0]) for each in fixes if not each.fix.valid).most_common()),
        compared=len(compared),
        median_m=_median(errors),
        p95_m=float(np.quantile(errors, 0.95)) if errors else math.nan,
        sd_m=_median([math.sqrt(np.trace(stated_cov(each, map_sd))) for each, _, _ in compared]),
        error_over_sd=math.sqrt(np.mean(squares) / 2.0) if squares else math.nan,
        inside=float(np.mean([square <= INSIDE_2 for square in squares])) if squares else math.nan,
        wrong=sum(square > WRONG_2 and error > WRONG_M for square, error in zip(squares, errors, strict=True)),
        error_over_bound=_rms(over_bound),
        cpu_s=_median([each.seconds for each in fixes]),
        filter_m=_rms([float(np.hypot(*sample.error)) for sample in filtered]),
    )


def stated_cov(each: MethodFix, map_sd: float) -> Array:
    """Covariance of fix and map, north and east, shape (2, 2) [m^2]."""
    north, east = each.fix.north_sd or 0.0, each.fix.east_sd or 0.0
    across = (each.fix.correlation or 0.0) * north * east
    return np.array([[north**2, across], [across, east**2]]) + map_sd**2 * np.eye(2)


def total_cov(each: MethodFix, map_sd: float) -> Array:
    """The same with the reference."""
    cov = stated_cov(each, map_sd)
    return cov if each.reference_cov is None else cov + each.reference_cov


def bound_with_map(bound: float, map_sd: float) -> float:
    """Bound of a profile with respect to the Earth, both axes together [m]."""
    return math.hypot(bound, math.sqrt(2.0) * map_sd)


def _reference_sd(each: MethodFix) -> float:
    return 0.0 if each.reference_cov is None else math.sqrt(np.trace(each.reference_cov))


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if len(values) else math.nan


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else math.nan
