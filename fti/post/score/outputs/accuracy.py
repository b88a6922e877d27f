"""Does the error of a quantity fit its limit, and the sigma that the messages state?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fti.hil.tables.limits import ScoreLimits
from fti.post.score.outputs.errors import QuantityError
from fti.post.score.outputs.row import OutputCheck, OutputRow, verdict_of
from fti.post.score.rows import Verdict
from fti.post.score.series import Array, Mask

#: So many errors say something about a sigma.
MIN_COUNT = 20
#: A sigma of more than fifty times the errors says nothing: RMS of error over sigma.
MIN_SIGMA_RATIO = 0.02
#: So large a share of the sigmas must be within the limit of the quantity: large ones excuse no error for long.
SIGMA_QUANTILE = 0.7
#: Behind an error that a fault explains: what navigation does not notice is told all the same.
DURING_FAULT = ", called valid during a fault"


def accuracy(
    topic: str, quantity: QuantityError, judged: Mask, t: Array, limits: ScoreLimits, *, lost: Mask
) -> Iterator[OutputRow]:
    """Rows of one quantity.

    judged : valid messages whose error no fault explains, shape (n,); t : their times [s]
    lost   : messages without a device that they rest on, shape (n,): their sigma may be large, and must still fit
    """
    known = judged & np.isfinite(quantity.error)
    if not known.any():
        return
    yield _error(topic, quantity, known, t, limits)
    stated = known & np.isfinite(quantity.sd)
    if quantity.must_state and not stated[known].all():
        yield _unstated(topic, quantity, known & ~stated, t)
    elif stated.any():
        yield _sigma(topic, quantity, stated, t, limits, sharp=stated & ~lost)


def excused_error_row(
    topic: str, quantity: QuantityError, excused: Mask, t: Array, limits: ScoreLimits
) -> Iterator[OutputRow]:
    """A row where values are wrong and called valid while a fault explains it; it is not judged.

    excused : valid messages during such faults, shape (n,)
    """
    known = excused & np.isfinite(quantity.error)
    if known.any():
        row = _error(topic, quantity, known, t, limits)
        if row.verdict is Verdict.FAILS:
            yield replace(row, verdict=Verdict.NOT_JUDGED, found=f"{row.found}{DURING_FAULT}")


def compared(
    topic: str, quantity: QuantityError, during: Mask, t: Array, limits: ScoreLimits, *, level: Array
) -> Iterator[OutputRow]:
    """A row that is judged: the largest error while a fault acts that explains no wrong value.

    during : valid messages of that time, shape (n,); level : protection level of the quantity, NaN where none, shape
    (n,): where one is stated it counts in place of sigmas
    """
    known = during & np.isfinite(quantity.error)
    if known.any():
        wide = replace(quantity, sd=np.where(np.isfinite(level), level / limits.worst_sigmas, quantity.sd))
        yield replace(_error(topic, wide, known, t, limits), check=OutputCheck.FAULT_ERROR)


def _error(topic: str, quantity: QuantityError, known: Mask, t: Array, limits: ScoreLimits) -> OutputRow:
    """The largest error beside what is allowed to it."""
    error = np.abs(quantity.error[known])
    allowed = np.fmax(quantity.limit, limits.worst_sigmas * np.nan_to_num(quantity.sd[known]))
    worst = int(np.argmax(error / allowed))
    return OutputRow(
        topic,
        OutputCheck.ERROR,
        quantity.name,
        verdict_of(bool(error[worst] <= allowed[worst])),
        f"{error[worst]:.3g} {quantity.unit} at most, RMS {np.sqrt(np.mean(error**2)):.3g} {quantity.unit}",
        f"<= {allowed[worst]:.3g} {quantity.unit}",
        float(t[known][worst]),
    )


def _unstated(topic: str, quantity: QuantityError, missing: Mask, t: Array) -> OutputRow:
    found = f"{np.count_nonzero(missing)} values without a sigma"
    return OutputRow(
        topic, OutputCheck.SIGMA, quantity.name, Verdict.FAILS, found, "a sigma with each value", float(t[missing][0])
    )


def _sigma(
    topic: str, quantity: QuantityError, stated: Mask, t: Array, limits: ScoreLimits, *, sharp: Mask
) -> OutputRow:
    """The share of errors beyond some sigmas; most sigmas, of all or of the sharp ones, no larger than allowed."""
    error, sd = np.abs(quantity.error[stated]), quantity.sd[stated]
    beyond = error > limits.sigmas * sd
    share, ratio = float(np.mean(beyond)), _rms_ratio(error, sd)
    high = min(float(np.quantile(quantity.sd[of], SIGMA_QUANTILE)) if of.any() else 0.0 for of in (stated, sharp))
    found = (
        f"{share:.1%} beyond {limits.sigmas:g} sigma, RMS {ratio:.2f} sigma, "
        f"{SIGMA_QUANTILE:.0%} of sigmas <= {high:.3g} {quantity.unit}"
    )
    limit = (
        f"<= {limits.beyond_share:.0%} beyond, RMS >= {MIN_SIGMA_RATIO:g} sigma, sigma > 0, "
        f"{SIGMA_QUANTILE:.0%} of sigmas <= {quantity.limit:.3g} {quantity.unit}"
    )
    enough = len(error) >= MIN_COUNT
    verdict = verdict_of(
        bool(np.all(sd > 0.0)) and share <= limits.beyond_share and ratio >= MIN_SIGMA_RATIO and high <= quantity.limit
    )
    at = float(t[stated][int(np.argmax(beyond))]) if beyond.any() else None
    return OutputRow(
        topic, OutputCheck.SIGMA, quantity.name, verdict if enough else Verdict.NOT_JUDGED, found, limit, at
    )


def _rms_ratio(error: Array, sd: Array) -> float:
    positive = sd > 0.0
    return float(np.sqrt(np.mean((error[positive] / sd[positive]) ** 2))) if positive.any() else 0.0
