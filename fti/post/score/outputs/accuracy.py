"""Checks of the error of a quantity against its limit and the stated sigma."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fti.arrays import Array, Mask
from fti.hil.tables.limits import ScoreLimits
from fti.post.score.outputs.errors import QuantityError
from fti.post.score.outputs.row import OutputCheck, OutputRow, result_of
from fti.post.score.rows import Result

#: Minimum number of errors for a check of sigmas.
MIN_COUNT = 20
#: Minimum RMS of error over sigma: sigmas of more than fifty times the errors are useless.
MIN_SIGMA_RATIO = 0.02
#: Share of the sigmas that must be within the limit of the quantity: sigmas may be large only briefly.
SIGMA_QUANTILE = 0.7
#: Appended to an error that a fault explains and navigation did not detect; it is reported, and does not fail.
DURING_FAULT = ", called valid during a fault"


def accuracy(
    topic: str, quantity: QuantityError, nominal: Mask, t: Array, limits: ScoreLimits, *, lost: Mask
) -> Iterator[OutputRow]:
    """Rows of one quantity.

    nominal : valid messages whose error no fault explains, shape (n,); t : their times [s]
    lost    : messages while a device that they need is lost, shape (n,): their sigma may be large, but must be correct
    """
    known = nominal & np.isfinite(quantity.error)
    if not known.any():
        return
    yield _error(topic, quantity, known, t, limits)
    stated = known & np.isfinite(quantity.sd)
    if quantity.must_state and not stated[known].all():
        missing = known & ~stated
        found, limit = f"{np.count_nonzero(missing)} values without a sigma", "a sigma with each value"
        yield OutputRow(topic, OutputCheck.SIGMA, quantity.name, Result.FAILS, found, limit, float(t[missing][0]))
    elif stated.any():
        yield _sigma(topic, quantity, stated, t, limits, sharp=stated & ~lost)


def explained_error_row(
    topic: str, quantity: QuantityError, explained: Mask, t: Array, limits: ScoreLimits
) -> Iterator[OutputRow]:
    """A row if values are wrong and flagged valid while a fault explains the error; it does not fail.

    explained : valid messages during such faults, shape (n,)
    """
    known = explained & np.isfinite(quantity.error)
    if known.any():
        row = _error(topic, quantity, known, t, limits)
        if row.result is Result.FAILS:
            yield replace(row, result=Result.NOT_COMPARED, found=f"{row.found}{DURING_FAULT}")


def fault_error_rows(
    topic: str, quantity: QuantityError, during: Mask, t: Array, limits: ScoreLimits, *, level: Array
) -> Iterator[OutputRow]:
    """A row for the largest error during a fault that explains no wrong value.

    during : valid messages of that time, shape (n,); level : protection level of the quantity, NaN where none, shape
    (n,); a stated level replaces the limit by sigmas
    """
    known = during & np.isfinite(quantity.error)
    if known.any():
        wide = replace(quantity, sd=np.where(np.isfinite(level), level / limits.worst_sigmas, quantity.sd))
        yield replace(_error(topic, wide, known, t, limits), check=OutputCheck.FAULT_ERROR)


def _error(topic: str, quantity: QuantityError, known: Mask, t: Array, limits: ScoreLimits) -> OutputRow:
    """The error with the largest ratio to its limit."""
    error = np.abs(quantity.error[known])
    allowed = np.fmax(quantity.limit, limits.worst_sigmas * np.nan_to_num(quantity.sd[known]))
    worst = int(np.argmax(error / allowed))
    return OutputRow(
        topic,
        OutputCheck.ERROR,
        quantity.name,
        result_of(bool(error[worst] <= allowed[worst])),
        f"{error[worst]:.3g} {quantity.unit} at most, RMS {np.sqrt(np.mean(error**2)):.3g} {quantity.unit}",
        f"<= {allowed[worst]:.3g} {quantity.unit}",
        float(t[known][worst]),
    )


def _sigma(
    topic: str, quantity: QuantityError, stated: Mask, t: Array, limits: ScoreLimits, *, sharp: Mask
) -> OutputRow:
    """The share of errors beyond some sigmas, and a quantile of all sigmas or of those without a lost device."""
    error, sd = np.abs(quantity.error[stated]), quantity.sd[stated]
    beyond = error > limits.sigmas * sd
    share, ratio = float(np.mean(beyond)), _rms_ratio(error, sd)
    high = min(float(np.quantile(quantity.sd[mask], SIGMA_QUANTILE)) if mask.any() else 0.0 for mask in (stated, sharp))
    text = (
        f"{share:.1%} beyond {limits.sigmas:g} sigma, RMS {ratio:.2f} sigma, "
        f"{SIGMA_QUANTILE:.0%} of sigmas <= {high:.3g} {quantity.unit}"
    )
    limit = (
        f"<= {limits.beyond_share:.0%} beyond, RMS >= {MIN_SIGMA_RATIO:g} sigma, sigma > 0, "
        f"{SIGMA_QUANTILE:.0%} of sigmas <= {quantity.limit:.3g} {quantity.unit}"
    )
    is_compared = len(error) >= MIN_COUNT
    result = result_of(
        bool(np.all(sd > 0.0)) and share <= limits.beyond_share and ratio >= MIN_SIGMA_RATIO and high <= quantity.limit
    )
    at = float(t[stated][int(np.argmax(beyond))]) if beyond.any() else None
    return OutputRow(
        topic, OutputCheck.SIGMA, quantity.name, result if is_compared else Result.NOT_COMPARED, text, limit, at
    )


def _rms_ratio(error: Array, sd: Array) -> float:
    positive = sd > 0.0
    return float(np.sqrt(np.mean((error[positive] / sd[positive]) ** 2))) if positive.any() else 0.0
