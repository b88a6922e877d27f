"""Fit of the receiver of an altimeter to its samples: beam, threshold of the leading edge, bias and scale.

    value = scale d(pose; beam, threshold) + bias + noise

d are ranges of the sensor models over known terrain (``range_tables``).  Every entry of a table gets its own bias and
scale.  Residuals are weighted by Tukey's biweight, with a sigma from their median, so that objects that are not in the
elevation files have no effect.  The priors are weak (``PRIOR_SD``): they determine parameters that a flight does not
show, as the beam over level ground, and the result lists these.

Nearest returns change smoothly with the beam: the best entry starts Gauss-Newton steps (``refine``).  One sigma, with
correlated errors of navigation and elevation, J the derivatives, w the weights, e the residuals:

    cov = H^-1 (sum over blocks of 10 s of g g^T + P) H^-1,    g = J^T w e / sigma^2,    H = J^T w J / sigma^2 + P

P the prior; or, if it is larger, with white errors and a slow one of 60 s, as of navigation: a flight of two minutes
has few blocks, which may all have the same error.

A leading edge jumps from one echo to the next with small changes of beam or threshold: derivatives are useless there.
So the best of all entries is selected (``choose``); its sigma is the spread of the best ones over 100 draws of blocks.

A constant error of the navigated height is a bias: its sigma is added to that of the bias.

Sources: Beaton and Tukey 1974 (biweight); Huber 1981, Robust statistics, 7; Liang and Zeger 1986 (blocks); Bell and
McCaffrey 2002 (few blocks); Kuensch 1989 (draws of blocks).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.hil.approach_reference.fit_samples import FitSamples
from fti.hil.approach_reference.range_tables import RangeTable

#: Tuning constant of the biweight: 95 % efficiency for normal errors.
TUKEY = 4.685
#: Sigma of normal errors over their median absolute value; minimum sigma [m].
SD_PER_MEDIAN, MIN_SD_M = 1.4826, 0.02
#: Block length within which errors are fully correlated [s].
BLOCK_S = 10.0
#: Correlation time of navigation errors [s]; minimum share of their variance that the fit leaves.
SLOW_S, MIN_SLOW_SHARE = 60.0, 0.02
#: Sigma of the navigated height over minutes, or its stated sigma if smaller (the emulated inertial unit, aided by
#: satellites: 0.3 to 0.6 m over 25 s means of three flights) [m].
WANDER_M = 0.5
#: Sigma of the priors: bias [m], scale, and parameters of a table by name.
PRIOR_BIAS_SD, PRIOR_SCALE_SD = 20.0, 0.05
PRIOR_SD = {"beam_deg": 30.0, "threshold_db": 6.0}
#: A parameter is observable if its sigma is smaller than this share of that of the prior.
MAX_SD_RATIO = 0.5
_ROUNDS, _STEPS, _HALVINGS, _DRAWS = 6, 40, 8, 100


@dataclass(frozen=True, eq=False)
class ReceiverFit:
    """A fitted receiver: names, values and one sigma of its parameters.

    sd           : sigma of the residuals, from their median [m]
    residuals    : measured minus predicted (n,) [m]; NaN without a prediction
    weights      : (n,), 0 for an outlier
    unobservable : names of the parameters that the flights do not show
    """

    names: tuple[str, ...]
    values: Array
    sds: Array
    sd: float
    residuals: Array
    weights: Array
    unobservable: tuple[str, ...]

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    def sd_of(self, name: str) -> float:
        """One sigma of a parameter."""
        return float(self.sds[self.names.index(name)])

    def cost(self, sd: float) -> float:
        """Mean biweight loss of the samples at a sigma [m], 1 at most; for the comparison of families."""
        return float(np.mean(_loss(self.residuals, sd)))


@dataclass(frozen=True, eq=False)
class Problem:
    """Samples, a table, and the prior: values (2 + parameters,) of bias, scale and the parameters of the table."""

    samples: FitSamples
    table: RangeTable
    prior: Array

    @property
    def prior_sd(self) -> Array:
        """One sigma of the prior."""
        return np.array([PRIOR_BIAS_SD, PRIOR_SCALE_SD, *(PRIOR_SD[name] for name in self.table.names)])

    def residuals(self, p: Array) -> Array:
        """Measured minus predicted [m]."""
        return np.asarray(self.samples.value - p[1] * self.table.at(p[2:]) - p[0])

    def jacobian(self, p: Array, free: slice) -> Array:
        """Derivatives (n, free parameters) of the prediction, 0 without a prediction."""
        ranges = self.table.at(p[2:])
        shape = range(len(self.table.axes)) if free == slice(None) else ()
        slopes = [p[1] * self.table.slope(p[2:], k) for k in shape]
        return np.asarray(np.nan_to_num(np.stack((np.ones_like(ranges), ranges, *slopes), axis=1)))

    def total(self, p: Array, sd: float) -> float:
        """Cost to minimise: loss of the samples and of the prior."""
        deviation = (p - self.prior) / self.prior_sd
        return float(TUKEY**2 / 6.0 * _loss(self.residuals(p), sd).sum() + 0.5 * np.sum(deviation**2))


def _loss(residuals: Array, sd: float) -> Array:
    """Biweight loss, 1 for an outlier and without a prediction."""
    share = np.minimum(np.nan_to_num(np.abs(residuals), nan=np.inf) / (TUKEY * sd), 1.0)
    return np.asarray(1.0 - (1.0 - share**2) ** 3)


def _weights(residuals: Array, sd: float) -> Array:
    share = np.minimum(np.nan_to_num(np.abs(residuals), nan=np.inf) / (TUKEY * sd), 1.0)
    return np.asarray((1.0 - share**2) ** 2)


def _spread(residuals: Array) -> float:
    """Sigma of residuals from the median of their absolute values [m]; infinite if half of them are unknown."""
    size = float(np.median(np.nan_to_num(np.abs(residuals), nan=np.inf)))
    return max(SD_PER_MEDIAN * size, MIN_SD_M)


def coarse_start(problem: Problem) -> tuple[Array, float]:
    """The best entry of a table with its bias and scale (2 + parameters,), and sigma of the residuals there [m].

    Raises ValueError if no entry has a prediction for half of the samples.
    """
    fits = [_linear(problem, np.array(entry)) for entry in itertools.product(*problem.table.axes)]
    sd = min(spread for _, spread in fits)
    if not math.isfinite(sd):
        raise ValueError("half of the samples have no prediction; the terrain must cover the flight")
    best = min((problem.total(p, sd), k) for k, (p, _) in enumerate(fits))[1]
    return fits[best][0], sd


def _linear(problem: Problem, entry: Array) -> tuple[Array, float]:
    """Bias and scale of one entry, by iterated reweighting."""
    difference = problem.samples.value - problem.table.at(entry)
    known = np.isfinite(difference)
    p = np.array([float(np.median(difference[known])) if known.any() else 0.0, 1.0, *entry])
    spread = _spread(problem.residuals(p))
    if not math.isfinite(spread):
        return p, spread
    for _ in range(_ROUNDS):
        step = _gauss_newton(problem, p, spread, slice(0, 2))
        p = p + np.append(step, np.zeros(len(entry)))
        spread = _spread(problem.residuals(p))
    return p, spread


def _gauss_newton(problem: Problem, p: Array, sd: float, free: slice) -> Array:
    """The Gauss-Newton step of the free parameters."""
    e = problem.residuals(p)
    w, J = _weights(e, sd) / sd**2, problem.jacobian(p, free)
    information = np.diag(problem.prior_sd[free] ** -2.0)
    gradient = J.T @ (w * np.nan_to_num(e)) + information @ (problem.prior - p)[free]
    return np.asarray(np.linalg.solve(J.T @ (w[:, None] * J) + information, gradient))


def refine(problem: Problem, start: Array, sd: float) -> ReceiverFit:
    """Minimise the cost from a start.  sd : sigma of the residuals for the weights [m]"""
    low = np.array([-np.inf, 0.5, *(axis[0] for axis in problem.table.axes)])
    high = np.array([np.inf, 2.0, *(axis[-1] for axis in problem.table.axes)])
    p = np.clip(start, low, high)
    for _ in range(_STEPS):
        step, before = _gauss_newton(problem, p, sd, slice(None)), problem.total(p, sd)
        candidates = (np.clip(p + step / 2.0**k, low, high) for k in range(_HALVINGS))
        better = next((q for q in candidates if problem.total(q, sd) < before - 1e-9), None)
        if better is None:
            break
        p = better
    return _build_fit(problem, p, sd, _sandwich(problem, p, sd, slice(None)))


def _blocks(s: FitSamples) -> NDArray[np.intp]:
    """Number of the block of each sample (n,)."""
    return np.asarray(np.unique(s.session * 1e6 + np.floor(s.t / BLOCK_S), return_inverse=True)[1])


def _sandwich(problem: Problem, p: Array, sd: float, free: slice) -> Array:
    """One sigma of the free parameters, with the others fixed."""
    e, block = problem.residuals(p), _blocks(problem.samples)
    w, J = _weights(e, sd), problem.jacobian(p, free)
    prior = np.diag(problem.prior_sd[free] ** -2.0)
    together = np.zeros((block.max() + 1, J.shape[1]))
    np.add.at(together, block, J * (w * np.nan_to_num(e))[:, None] / sd**2)
    inverse = np.linalg.inv(J.T @ (w[:, None] * J) / sd**2 + prior)
    few = (len(together) / max(len(together) - J.shape[1], 1)) ** 2
    by_blocks = few * together.T @ together
    by_slow = _slow_scores(problem.samples, e, w / sd**2, J)
    spreads = [np.diag(inverse @ (scores + prior) @ inverse) for scores in (by_blocks, by_slow)]
    return np.asarray(np.sqrt(np.max(spreads, axis=0)))


def _slow_scores(s: FitSamples, e: Array, w: Array, J: Array) -> Array:
    """Covariance of J^T w e with white errors and a slow one, exp(-t / 60 s), separately per session.

    The sigma of the slow one is that of the block means.  The fit removes the part of it that its parameters can model:
    with R the correlation of the blocks and M the residual projection of the fit, tr(M R M) / blocks remains.
    A few minutes show little of it: it is at least ``WANDER_M``.
    """
    known = w > 0.0
    number = np.unique(_blocks(s)[known], return_inverse=True)[1]
    count = np.bincount(number).astype(float)
    t, session, mean = (np.bincount(number, column[known]) / count for column in (s.t, s.session, np.nan_to_num(e)))
    white = float(np.mean((e[known] - mean[number]) ** 2))
    correlation = np.exp(-np.abs(t[:, None] - t) / SLOW_S) * (session[:, None] == session)
    design, scores = np.zeros((len(count), J.shape[1])), np.zeros((len(count), J.shape[1]))
    np.add.at(design, number, J[known] / count[number][:, None])
    np.add.at(scores, number, J[known] * w[known, None])
    projection = np.eye(len(count)) - design @ np.linalg.pinv(design)
    remaining = max(float(np.trace(projection @ correlation @ projection)) / len(count), MIN_SLOW_SHARE)
    known_slow = min(float(np.mean(s.vertical_sd)), WANDER_M) ** 2
    slow = max(float(np.mean((projection @ mean) ** 2 - white / count)) / remaining, known_slow)
    return np.asarray(slow * scores.T @ correlation @ scores + white * (J * w[:, None] ** 2).T @ J)


def _build_fit(problem: Problem, p: Array, sd: float, sds: Array) -> ReceiverFit:
    e, names = problem.residuals(p), ("bias_m", "scale", *problem.table.names)
    observable = sds < MAX_SD_RATIO * problem.prior_sd
    total_sds = sds.copy()
    total_sds[0] = math.hypot(sds[0], _navigation_sd(problem.samples))
    unobservable = tuple(name for name, is_seen in zip(names, observable, strict=True) if not is_seen)
    return ReceiverFit(names, p, total_sds, _spread(e), e, _weights(e, sd), unobservable)


def choose(problems: Sequence[Problem]) -> ReceiverFit:
    """The best entry of several tables of the same samples, the finest one last."""
    entries = [(problem, np.array(entry)) for problem in problems for entry in itertools.product(*problem.table.axes)]
    fits = [_linear(problem, entry) for problem, entry in entries]
    sd = min(spread for _, spread in fits)
    points, last = np.array([p for p, _ in fits]), problems[-1]
    block = _blocks(last.samples)
    losses = np.array(
        [np.bincount(block, _loss(problem.residuals(p), sd)) for (problem, _), p in zip(entries, points, strict=True)]
    )
    prior_cost = 0.5 * np.sum(((points - last.prior) / last.prior_sd) ** 2, axis=1)
    best = int(np.argmin(TUKEY**2 / 6.0 * losses.sum(axis=1) + prior_cost))
    blocks = losses.shape[1]
    draws = np.random.default_rng(1).multinomial(blocks, np.full(blocks, 1.0 / blocks), size=_DRAWS)
    drawn = points[np.argmin(TUKEY**2 / 6.0 * draws @ losses.T + prior_cost, axis=1)]
    steps = np.array([0.0, 0.0, *(float(np.min(np.diff(axis))) for axis in last.table.axes)])
    problem, p = entries[best][0], points[best]
    bias_sds = np.append(_sandwich(problem, p, sd, slice(0, 2)), np.zeros(len(steps) - 2))
    return _build_fit(problem, p, sd, np.sqrt(np.mean((drawn - p) ** 2, axis=0) + steps**2 / 12.0 + bias_sds**2))


def _navigation_sd(s: FitSamples) -> float:
    """One sigma of the common error of all navigated heights [m]: that of one, averaged over the sessions."""
    return math.sqrt(float(np.mean(s.vertical_sd**2)) / len(np.unique(s.session)))
