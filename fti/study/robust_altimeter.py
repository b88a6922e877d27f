"""Inertial height and radio altimeter: effect of a filter that refuses outliers.

Source 001 (Hajiyev), tables 1 and 2.  N = runs of 500 iterations of 0.1 s, the unit is the run; both variants of
erratum H1.  Not in the source, and chosen here: P0 = diag(initial errors squared), a slow altimeter error of 2 m, the
confidence region |nu| <= 3 sigma.

    T25   INS error after 500 iterations.  Printed (radius in kilometres, noise not times the step): 188 +- 19 m, exact;
          each of the ten rows of table 1 within the 99.9 % band.  Physical: 24.5 m; 212.5 m is impossible
    T26   iterations 101, 201, 301, 401 with a hundred times the noise; jump = change of the estimated INS error there.
          For each of them: median without over median with refusal >= 20 (lower 99 % limit, bootstrap over runs);
          median and 95 % of the runs with refusal < 1 m (upper 99 % limits, order statistics).  2.4 % of the faults
          are too small to differ from noise
    H     consistency, truth drawn from P0, Q, R: RMS of error over sigma, each state, ten instants: 0.80 to 1.25; mean
          NEES / 5 and NIS: 95 % bootstrap interval inside 0.85 to 1.15, nine of ten instants in that band
    L     lock-out: the inertial height is set wrong by 300 m at iteration 250.  Refusal for ever stays wrong; refusal
          that is bounded (10 s) is within 3 sigma again at iteration 500: of 100 runs 95 or more
    F     the live form (``fti.nav.vertical.vertical_channel``) in flights of ten minutes, half as many as runs:
          satellites are lost for eight of them; five wild returns in a hundred.  Height: RMS of error over sigma at
          eight instants 0.80 to 1.25; NEES / 2 as above; with a richer truth than the filter's model <= 1.5.  The
          channel without an altimeter is reported
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fti.nav.vertical.error_model import HEIGHT, STATES
from fti.nav.vertical.kalman_filter import GATE
from fti.parallel_runs import Progress
from fti.study import REPORTED, DrawFigure, StudyResult
from fti.study._statistics import RESAMPLINGS
from fti.study._vertical_channel import (
    FAULT_STEPS,
    INSTANTS,
    ITERATIONS,
    PHYSICAL,
    PRINTED,
    ChannelEstimate,
    ChannelTruth,
    ChannelVariant,
    estimate,
    expected_error,
    simulate,
)

Array = NDArray[np.float64]

RUNS = 1000
SEED = 1

#: INS error of table 1, iterations 50, 100 ... 500, and error of the integrated height [m].
TABLE_1 = (23.8841, 26.7612, 31.9571, 39.9773, 51.5466, 67.6660, 89.6901, 119.4324, 159.3070, 212.5156)
TABLE_1_LEFT = (11.1194, -1.6229, 4.3391, 7.3407, -5.0445, 1.5723, -10.7381, 9.7124, 0.1315, -2.1919)
#: Values of erratum H1 [m]: printed, mean and sigma; physical.
PRINTED_M, PRINTED_SD_M, PHYSICAL_M = 188.0, 19.0, 24.5
#: Half width of the 99.9 % band of a normal distribution [sigma]: ten rows at 0.01 together.
BAND = 3.29
MIN_RATIO, MAX_JUMP_M = 20.0, 1.0
#: Sigma of the 99 % limits of order statistics.
ONE_SIDED = 2.33
CONSISTENT_RMS, CONSISTENT_BAND, MIN_INSTANT_SHARE = (0.80, 1.25), (0.85, 1.15), 0.9
#: Lock-out: iteration, offset [m], duration of refusal [s], percentage of runs that must recover.
OFFSET_STEP, OFFSET_M, LOCKOUT_S, MIN_RECOVERED = 250, 300.0, 10.0, 95
#: Runs over flights of the live form.  With 200 flights the NEES of one instant scatters by 7 %,
#: and all eight lie within 15 % three times out of four only, even for a consistent filter.
FLIGHTS = 2
#: Share of all parts but the flights in the progress.
CHANNEL_SHARE = 0.2


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """All of it."""
    from fti.study import _vertical_flights as flights  # noqa: PLC0415 - starts processes

    results = table_1(runs, seed)
    for variant in (PRINTED, PHYSICAL):
        results += faults(variant, runs, seed)
    progress(0.5 * CHANNEL_SHARE)
    results += [*consistency(PRINTED, runs, seed), *consistency(PHYSICAL, runs, seed), *lockout(runs, seed)]
    progress(CHANNEL_SHARE)
    many = max(2, runs // FLIGHTS)
    return results + flights.judge_flights(
        many, seed, lambda share: progress(CHANNEL_SHARE + (1 - CHANNEL_SHARE) * share)
    )


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Figures 2 to 7 of the source again."""
    from fti.study import _vertical_plots as plots  # noqa: PLC0415 - matplotlib is slow to load

    return {
        "optimal": lambda: plots.one_run(PRINTED, seed, math.inf, faulted=False),
        "faults": lambda: plots.one_run(PRINTED, seed, math.inf, faulted=True),
        "robust": lambda: plots.one_run(PRINTED, seed, GATE, faulted=True),
        "robust-physical": lambda: plots.one_run(PHYSICAL, seed, GATE, faulted=True),
        "jumps": lambda: plots.jumps_at_faults(seed),
        "flight": lambda: plots.flight(seed),
    }


def _rng(seed: int, *what: int) -> np.random.Generator:
    return np.random.default_rng([seed, *what])


# ----------------------------------------------------------------------------------------------------------------- T25


def table_1(runs: int, seed: int) -> list[StudyResult]:
    """INS error after 500 iterations, exact and drawn, compared with the source's rows."""
    mean, sd = expected_error(PRINTED, ITERATIONS)
    rows = [
        (error - m) / s for k, error in zip(INSTANTS, TABLE_1, strict=True) for m, s in [expected_error(PRINTED, k)]
    ]
    worst = float(np.max(np.abs(rows)))
    physical, physical_sd = expected_error(PHYSICAL, ITERATIONS)
    off = (TABLE_1[-1] - physical) / physical_sd
    truth = simulate(PRINTED, runs, _rng(seed, 1), drawn=False, faulted=False)
    found = estimate(PRINTED, truth.z, math.inf)
    drawn, left = truth.x[-1, :, HEIGHT], (found.x - truth.x)[list(INSTANTS), :, HEIGHT]
    return [
        StudyResult("T25.printed", "INS error, 500 iterations as printed, mean [m], exact", mean, "188 +- 1",
               abs(mean - PRINTED_M) < 1.0),
        StudyResult("T25.printed_sd", "its one sigma [m], exact", sd, "19 +- 1", abs(sd - PRINTED_SD_M) <= 1.0),
        StudyResult("T25.drawn", f"the same, mean of {runs} runs [m]", float(drawn.mean()), REPORTED, holds=True),
        StudyResult("T25.source", "212.5 m of the source against it [sigma]", float(rows[-1]), "|z| <= 1.96",
               abs(rows[-1]) <= 1.96),
        StudyResult("T25.rows", "worst of ten rows of table 1 [sigma]", worst, f"<= {BAND}", worst <= BAND),
        StudyResult("T25.physical", "INS error, physical, mean [m], exact", physical, "24.5 +- 0.1",
               abs(physical - PHYSICAL_M) < 0.1),
        StudyResult("T25.not_physical", "212.5 m against that [sigma]", off, f"> {BAND}", off > BAND),
        StudyResult("T25.left", f"error of the integrated height, RMS of {runs} runs [m]", _rms(left), REPORTED,
               holds=True),
        StudyResult("T25.left_source", "the same in the source's one run [m]", _rms(TABLE_1_LEFT), REPORTED,
               holds=True),
    ]  # fmt: skip


# ----------------------------------------------------------------------------------------------------------------- T26


def jumps(found: ChannelEstimate) -> Array:
    """Change of the estimated INS error at the four faulted iterations [m], shape (4, runs)."""
    at = np.array(FAULT_STEPS)
    return np.abs(found.x[at, :, HEIGHT] - found.x[at - 1, :, HEIGHT])


def faults(variant: ChannelVariant, runs: int, seed: int) -> list[StudyResult]:
    """T26 in one variant: the same runs without and with refusal."""
    truth = simulate(variant, runs, _rng(seed, 2), drawn=False, faulted=True)
    found = estimate(variant, truth.z, GATE)
    return judge_faults(variant.name, jumps(estimate(variant, truth.z, math.inf)), jumps(found), found.accepted, seed)


def judge_faults(name: str, plain: Array, robust: Array, accepted: NDArray[np.bool_], seed: int) -> list[StudyResult]:
    """Worst of the four faults; jumps of shape (4, runs)."""
    runs = plain.shape[1]
    ratio = min(_min_ratio(p, r, _rng(seed, 3)) for p, r in zip(plain, robust, strict=True))
    middle, jump_95 = (max(_upper(jump, share) for jump in robust) for share in (0.5, 0.95))
    passed = 100.0 * float(np.mean(accepted[list(FAULT_STEPS)]))
    words = f"{name}, worst of four faults, {runs} runs"
    return [
        StudyResult(f"T26.{name}.ratio", f"median jump without over with refusal, {words}, lower 99 % limit", ratio,
               f">= {MIN_RATIO:g}", ratio >= MIN_RATIO),
        StudyResult(f"T26.{name}.median", f"jump with refusal, {words}: median [m], upper 99 % limit", middle,
               f"< {MAX_JUMP_M:g}", middle < MAX_JUMP_M),
        StudyResult(f"T26.{name}.most", "the same: 95 % of the runs [m]", jump_95,
               f"< {MAX_JUMP_M:g}", jump_95 < MAX_JUMP_M),
        StudyResult(f"T26.{name}.plain", f"jump without refusal, {name}: median, of the worst fault [m]",
               float(np.max(np.median(plain, axis=1))), REPORTED, holds=True),
        StudyResult(f"T26.{name}.plain_most", "the same: 95 % of the runs [m]",
               float(np.max(np.quantile(plain, 0.95, axis=1))), REPORTED, holds=True),
        StudyResult(f"T26.{name}.passed", "faults that pass the region [%]", passed, REPORTED, holds=True),
    ]  # fmt: skip


def _min_ratio(plain: Array, robust: Array, rng: np.random.Generator) -> float:
    drawn = rng.integers(0, len(plain), (RESAMPLINGS, len(plain)))
    return float(np.quantile(np.median(plain[drawn], axis=1) / np.median(robust[drawn], axis=1), 0.01))


def _upper(values: Array, share: float) -> float:
    """Upper 99 % limit of a quantile: an order statistic (normal approximation of the binomial)."""
    n = len(values)
    k = math.ceil(n * share + ONE_SIDED * math.sqrt(n * share * (1.0 - share)))
    return float(np.sort(values)[min(k, n - 1)])


# ------------------------------------------------------------------------------------------------------------- honesty


def consistency(variant: ChannelVariant, runs: int, seed: int) -> list[StudyResult]:
    """Both filters: the optimal one without faults, the robust one with them."""
    results = []
    for name, gate, faulted in (("optimal", math.inf, False), ("robust", GATE, True)):
        truth = simulate(variant, runs, _rng(seed, 4), drawn=True, faulted=faulted)
        found = estimate(variant, truth.z, gate)
        results += judge_consistency(f"H.{variant.name}.{name}", *scores(truth, found), seed)
    return results


def scores(truth: ChannelTruth, found: ChannelEstimate) -> tuple[Array, Array, Array]:
    """Error over sigma (instants, runs, 5), NEES / 5 (instants, runs), NIS of sound measurements (1, runs)."""
    at = list(INSTANTS)
    error = (found.x - truth.x)[at]
    nees = np.einsum("tri,tri->tr", error, np.linalg.solve(found.P, error[..., None])[..., 0])
    sound = np.setdiff1d(np.arange(1, ITERATIONS + 1), FAULT_STEPS)
    return error / found.sd[at], nees / STATES, np.mean(found.innovation[sound] ** 2, axis=0, keepdims=True)


def judge_consistency(name: str, normal: Array, nees: Array, nis: Array, seed: int) -> list[StudyResult]:
    """Judge by the criteria in the module docstring."""
    rms = np.sqrt(np.mean(normal**2, axis=1)).ravel()
    low, high = float(rms.min()), float(rms.max())
    words = f"RMS of error over sigma, {rms.size} of state and instant, {normal.shape[1]} runs"
    return [
        _judge_band(f"{name}.least", f"{words}: least", low, low, CONSISTENT_RMS),
        _judge_band(f"{name}.most", f"{words}: most", high, high, CONSISTENT_RMS),
        *_judge_mean(f"{name}.nees", "NEES over its mean", nees, seed),
        *_judge_mean(f"{name}.nis", "NIS over its mean", nis, seed)[:1],
    ]


def _judge_mean(name: str, what: str, values: Array, seed: int) -> list[StudyResult]:
    """Mean over runs and its 95 % interval, and the share of instants with the mean in the band; (instants, runs)."""
    runs = values.mean(axis=0)
    drawn = _rng(seed, 5).integers(0, len(runs), (RESAMPLINGS, len(runs)))
    low, high = np.quantile(runs[drawn].mean(axis=1), [0.025, 0.975])
    each = values.mean(axis=1)
    inside = float(np.mean((each > CONSISTENT_BAND[0]) & (each < CONSISTENT_BAND[1])))
    words = f"{what}, mean of {len(runs)} runs, 95 % [{low:.3f}, {high:.3f}]"
    return [
        _judge_band(name, words, float(runs.mean()), (float(low), float(high)), CONSISTENT_BAND),
        StudyResult(f"{name}_instants", f"share of {len(each)} instants with it in that band", inside,
               f">= {MIN_INSTANT_SHARE:g}", inside >= MIN_INSTANT_SHARE),
    ]  # fmt: skip


def _judge_band(
    name: str, quantity: str, value: float, target: float | tuple[float, float], band: tuple[float, float]
) -> StudyResult:
    low, high = target if isinstance(target, tuple) else (target, target)
    return StudyResult(name, quantity, value, f"{band[0]:.2f} to {band[1]:.2f}", band[0] < low and high < band[1])


# ------------------------------------------------------------------------------------------------------------ lock-out


def lockout(runs: int, seed: int) -> list[StudyResult]:
    """An inertial height with an offset: unlimited and bounded refusal."""
    truth = simulate(PHYSICAL, runs, _rng(seed, 6), drawn=True, faulted=False)
    truth.x[OFFSET_STEP:, :, HEIGHT] += OFFSET_M
    truth.z[OFFSET_STEP:] += OFFSET_M

    def recovered(lockout_s: float) -> int:
        found = estimate(PHYSICAL, truth.z, GATE, lockout_s)
        error = np.abs(found.x[-1] - truth.x[-1])[:, HEIGHT]
        return int(np.count_nonzero(error <= 3.0 * found.sd[-1, :, HEIGHT]))

    bounded, ever, min_recovered = recovered(LOCKOUT_S), recovered(math.inf), MIN_RECOVERED * runs / 100
    words = f"runs of {runs} within 3 sigma, 25 s after a step of {OFFSET_M:g} m"
    return [
        StudyResult(
            "L.bounded",
            f"{words}: refusal bounded by {LOCKOUT_S:g} s",
            bounded,
            f">= {min_recovered:g}",
            bounded >= min_recovered,
        ),
        StudyResult("L.ever", f"{words}: refusal for ever", ever, REPORTED, holds=True),
    ]


def _rms(values: Array | tuple[float, ...]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
