"""Runs of the source's channel: with faults, for consistency, and with a lock-out; flights of the live form."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Mask
from fti.nav.vertical.error_model import HEIGHT, STATES
from fti.nav.vertical.kalman_filter import GATE
from fti.parallel_runs import Progress, run_all
from fti.study.robust_altimeter import channel
from fti.study.robust_altimeter.flights import VerticalCase, VerticalFlight, fly

#: Lock-out: iteration, offset [m], duration of refusal [s].
OFFSET_STEP, OFFSET_M, LOCKOUT_S = 250, 300.0, 10.0
#: Divisor of the number of flights with the richer truth, and without an altimeter.
REDUCTION_FACTOR = 4


class FaultJumps(NamedTuple):
    """Jumps without and with refusal [m], shape (4, runs), and the measurements that the refusal accepted."""

    plain: Array
    robust: Array
    accepted: Mask


class ChannelScores(NamedTuple):
    """Error over sigma (instants, runs, states), NEES over its mean (instants, runs), NIS (1 or instants, runs)."""

    normal: Array
    nees: Array
    nis: Array


class FlightSets(NamedTuple):
    """Flights of the live form: truth of the filter's model, richer truth, and without an altimeter."""

    matched: list[VerticalFlight]
    rich: list[VerticalFlight]
    alone: list[VerticalFlight]


def height_errors(runs: int, seed: int) -> tuple[Array, Array]:
    """INS error at the end (runs,), and error of the integrated height at the instants (10, runs) [m], as printed."""
    truth = channel.simulate(channel.PRINTED, runs, np.random.default_rng([seed, 1]), drawn=False, faulted=False)
    found = channel.estimate(channel.PRINTED, truth.z, math.inf)
    return truth.x[-1, :, HEIGHT], (found.x - truth.x)[list(channel.INSTANTS), :, HEIGHT]


def jumps(found: channel.ChannelEstimate) -> Array:
    """Change of the estimated INS error at the four faulted iterations [m], shape (4, runs)."""
    at = np.array(channel.FAULT_STEPS)
    return np.abs(found.x[at, :, HEIGHT] - found.x[at - 1, :, HEIGHT])


def fault_jumps(variant: channel.ChannelVariant, runs: int, seed: int) -> FaultJumps:
    """The same runs without and with refusal."""
    truth = channel.simulate(variant, runs, np.random.default_rng([seed, 2]), drawn=False, faulted=True)
    found = channel.estimate(variant, truth.z, GATE)
    return FaultJumps(jumps(channel.estimate(variant, truth.z, math.inf)), jumps(found), found.accepted)


def consistency_scores(variant: channel.ChannelVariant, runs: int, seed: int) -> dict[str, ChannelScores]:
    """Of the optimal filter without faults, and of the robust one with them."""
    results = {}
    for name, gate, faulted in (("optimal", math.inf, False), ("robust", GATE, True)):
        truth = channel.simulate(variant, runs, np.random.default_rng([seed, 4]), drawn=True, faulted=faulted)
        results[name] = scores(truth, channel.estimate(variant, truth.z, gate))
    return results


def scores(truth: channel.ChannelTruth, found: channel.ChannelEstimate) -> ChannelScores:
    """Of all five states; NIS of sound measurements."""
    at = list(channel.INSTANTS)
    error = (found.x - truth.x)[at]
    nees = np.einsum("tri,tri->tr", error, np.linalg.solve(found.P, error[..., None])[..., 0])
    sound = np.setdiff1d(np.arange(1, channel.ITERATIONS + 1), channel.FAULT_STEPS)
    return ChannelScores(
        error / found.sd[at], nees / STATES, np.mean(found.innovation[sound] ** 2, axis=0, keepdims=True)
    )


def recovered_runs(runs: int, seed: int, lockout_s: float) -> int:
    """Number of runs within 3 sigma at the end, after a step of the inertial height, by the bound of refusal [s]."""
    truth = channel.simulate(channel.PHYSICAL, runs, np.random.default_rng([seed, 6]), drawn=True, faulted=False)
    truth.x[OFFSET_STEP:, :, HEIGHT] += OFFSET_M
    truth.z[OFFSET_STEP:] += OFFSET_M
    found = channel.estimate(channel.PHYSICAL, truth.z, GATE, lockout_s)
    error = np.abs(found.x[-1] - truth.x[-1])[:, HEIGHT]
    return int(np.count_nonzero(error <= 3.0 * found.sd[-1, :, HEIGHT]))


def fly_all(flights: int, seed: int, progress: Progress) -> FlightSets:
    """``flights`` of matched truth, a fourth of that of richer truth and without an altimeter."""
    few = max(2, flights // REDUCTION_FACTOR)
    kinds = [[VerticalCase(seed, i) for i in range(flights)], [VerticalCase(seed, i, rich=True) for i in range(few)],
             [VerticalCase(seed, i, altimeter=False) for i in range(few)]]  # fmt: skip
    found = iter(run_all(fly, [case for kind in kinds for case in kind], progress))
    return FlightSets(*([next(found) for _ in kind] for kind in kinds))


def flight_scores(flights: list[VerticalFlight]) -> ChannelScores:
    """Of height and climb; half the sum of their squares has the mean 1 whatever the correlation of the two is."""
    height = np.stack([f.at_instants((f.found - f.alt) / f.sd) for f in flights], axis=1)
    climb = np.stack([f.at_instants(f.climb_error / f.climb_sd) for f in flights], axis=1)
    normal = np.stack([height, climb], axis=-1)
    squares = np.asarray(0.5 * np.sum(normal**2, axis=-1))
    return ChannelScores(normal, squares, squares)
