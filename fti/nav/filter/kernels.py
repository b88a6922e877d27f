"""Numerical kernels of the filter: a step of estimate and covariance, and the update with one scalar.

    P <- Phi P Phi^T + Q,       Phi = 1 + F T + (F T)^2 / 2
    g = P h,  s = h g + r,  k = g / s:    P <- P - k g^T - g k^T + s k k^T     Joseph's form, written out

Joseph's form (1 - k h) P (1 - k h)^T + r k k^T stays symmetric and positive with any rounding of k; equation 3.38
of Spiegel 2018, P - k h P, does not (docs/errata.md).  Source: Bierman 1977, ch. II; Groves 2013, section 3.2.
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import (
    SEMI_MAJOR,
    Vector,
    geodetic_from_ecef,
    mat_en,
    mat_from_quat,
    normalised,
    quat_from_turn,
    quat_product,
)
from fti.kernel import kernel
from fti.nav.inertial.ins_error_model import ACCEL, BIASED, GYRO, TURN, VEL, noise, rates, transition
from fti.nav.inertial.strapdown_fast import move

#: Indices of an estimate's row: position, velocity, quaternion e; accelerometer and gyro bias b; extras.
QUAT, ACCEL_BIAS, GYRO_BIAS, EXTRAS = 6, 10, 13, 16
#: Duration of a turn, for which a heading error acts [s].
TURN_S = 20.0
#: Largest plausible change from one sample to the next [m/s^2, rad/s].
SHOCK, SHOCK_TURN = 30.0, 2.0


@kernel
def step(  # noqa: PLR0917
    y: Array, P: Array, imu_start: Array, imu_end: Array, bend: Array, unit: Array, drifts: Array, seconds: float
) -> None:
    """Propagate estimate and covariance, in place.

    y      : ndarray, shape (16 + k,)     the estimate, see the module's ``QUAT`` and so on
    P      : ndarray, shape (n, n)        n = 9 + k or 15 + k
    imu_start, imu_end, bend : shape (6,) accel_b, gyro_b measured at the start and end; their second derivatives
    unit   : ndarray, shape (2, 4)        ``ImuErrorModel.table``
    drifts : ndarray, shape (k, 4)        ``FilterModel.drifts``
    seconds : > 0 [s]
    """
    first, last = _without_errors(y, imu_start, drifts), _without_errors(y, imu_end, drifts)
    middle = 0.5 * (first + last)
    before = matrix(y)
    biased = len(P) - len(drifts) == BIASED
    move(y, first, last, bend, seconds)
    mat_eb = 0.5 * (before + matrix(y))
    force_e = np.empty(3)
    for i in range(3):
        force_e[i] = mat_eb[i, 0] * middle[0] + mat_eb[i, 1] * middle[1] + mat_eb[i, 2] * middle[2]
    down_e = -y[0:3] / np.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2)
    phi = transition(rates(mat_eb, force_e, down_e, biased), seconds)
    accel, gyro = noise(unit, middle[0:3], middle[3:6], biased)
    speed = np.sqrt(y[3] ** 2 + y[4] ** 2 + y[5] ** 2)
    _add_heading_noise(P, force_e, down_e, seconds)
    _spread(P, phi)
    _spread_gyro_matrix(P, mat_eb, middle[3:6], drifts, seconds)
    for i in range(3):
        P[VEL + i, VEL + i] += accel * seconds
        P[TURN + i, TURN + i] += gyro * seconds
    _add_shock_noise(P, imu_start, imu_end, seconds)
    if biased:
        _step_biases(y, P, unit, seconds)
    for i in range(len(drifts)):
        _step_gauss_markov(
            y, EXTRAS + i, P, len(P) - len(drifts) + i, drifts[i, 0], drifts[i, 1] + speed * drifts[i, 2], seconds
        )


@kernel
def coast(  # noqa: PLR0917
    y: Array, P: Array, imu_start: Array, imu_end: Array, bends: Array, unit: Array, drifts: Array, seconds: Array
) -> None:
    """Propagate an estimate through m steps, in place, and its covariance with one transition for all of them.

    The transition uses the time-weighted means of force and attitude: a turn of 0.2 s at 60 deg/s is 12 deg, of which
    third-order terms are neglected.

    imu_start, imu_end, bends : ndarray, shape (m, 6)   of each step, as in ``step``
    seconds : ndarray, shape (m,)   > 0 [s]
    """
    biased = len(P) - len(drifts) == BIASED
    total, accel, gyro, distance = 0.0, 0.0, 0.0, 0.0
    force_e, mean_eb = np.zeros(3), np.zeros((3, 3))
    for m in range(len(seconds)):
        first, last = _without_errors(y, imu_start[m], drifts), _without_errors(y, imu_end[m], drifts)
        middle = 0.5 * (first + last)
        before = matrix(y)
        move(y, first, last, bends[m], seconds[m])
        mat_eb = 0.5 * (before + matrix(y))
        for i in range(3):
            for j in range(3):
                mean_eb[i, j] += mat_eb[i, j] * seconds[m]
                force_e[i] += mat_eb[i, j] * middle[j] * seconds[m]
        more_accel, more_gyro = noise(unit, middle[0:3], middle[3:6], biased)
        accel += more_accel * seconds[m]
        gyro += more_gyro * seconds[m]
        distance += np.sqrt(y[3] ** 2 + y[4] ** 2 + y[5] ** 2) * seconds[m]
        total += seconds[m]
        _spread_gyro_matrix(P, mat_eb, middle[3:6], drifts, seconds[m])
        _add_shock_noise(P, imu_start[m], imu_end[m], seconds[m])
    down_e = -y[0:3] / np.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2)
    _add_heading_noise(P, force_e / total, down_e, total)
    _spread(P, transition(rates(mean_eb / total, force_e / total, down_e, biased), total))
    for i in range(3):
        P[VEL + i, VEL + i] += accel
        P[TURN + i, TURN + i] += gyro
    if biased:
        _step_biases(y, P, unit, total)
    for i in range(len(drifts)):
        rate = drifts[i, 1] + distance / total * drifts[i, 2]
        _step_gauss_markov(y, EXTRAS + i, P, len(P) - len(drifts) + i, drifts[i, 0], rate, total)


@kernel
def separate(  # noqa: PLR0917
    y: Array, P: Array, other_y: Array, other_P: Array, mat_en: Array, min_share: float
) -> tuple[Array, Array, float]:
    """Difference of an estimate from another one with fewer measurements: y - other_y in north, east, down.

    Returns : ndarray, shape (3, 6)   difference of position [m] and velocity [m/s]; its sigma, from other_P - P, at
              least ``min_share`` of that of y; sigma of the other one
              ndarray, shape (2,)     difference over sigma of position and velocity in any horizontal direction
              float   the largest sigma of the other one's horizontal position in any direction [m]
    """
    result = np.zeros((3, 6))
    for i in range(6):
        at = i - i % 3
        variance = other_variance = 0.0
        for j in range(3):
            turn = mat_en[j, i % 3]
            result[0, i] += turn * (y[at + j] - other_y[at + j])
            for k in range(3):
                variance += turn * P[at + j, at + k] * mat_en[k, i % 3]
                other_variance += turn * other_P[at + j, at + k] * mat_en[k, i % 3]
        result[1, i] = np.sqrt(max(other_variance - variance, min_share**2 * variance))
        result[2, i] = np.sqrt(other_variance)
    ratios = np.empty(2)
    for part in range(2):
        at = 3 * part
        covariance = _across(other_P, mat_en, at) - _across(P, mat_en, at)
        correlation = covariance / (result[1, at] * result[1, at + 1])
        ratios[part] = _level_ratio(result[0, at] / result[1, at], result[0, at + 1] / result[1, at + 1], correlation)
    return result, ratios, largest_sd(result[2, 0] ** 2, result[2, 1] ** 2, _across(other_P, mat_en, 0))


@kernel
def _across(P: Array, mat_en: Array, at: int) -> float:
    """Covariance of north and east, of the three states from ``at`` on."""
    result = 0.0
    for j in range(3):
        for k in range(3):
            result += mat_en[j, 0] * P[at + j, at + k] * mat_en[k, 1]
    return result


@kernel
def _level_ratio(north: float, east: float, correlation: float) -> float:
    """The largest ratio of a horizontal difference to its sigma, over all directions.  north, east : over their sigma

    It is the Mahalanobis distance, limited to its value without correlation: the difference of two covariances is
    inaccurate in its smallest axis.
    """
    r = min(max(correlation, -0.99), 0.99)
    distance = np.sqrt((north * north - 2.0 * r * north * east + east * east) / (1.0 - r * r))
    return float(max(np.abs(north), np.abs(east), min(distance, np.hypot(north, east))))


@kernel
def largest_sd(north: float, east: float, across: float) -> float:
    """The largest sigma in any direction of two axes, from their variances and the covariance ``across``."""
    half = 0.5 * np.hypot(north - east, 2.0 * across)
    return float(np.sqrt(max(0.0, 0.5 * (north + east) + half)))


@kernel
def _add_heading_noise(P: Array, force_e: Array, down_e: Array, seconds: float) -> None:
    """Noise for what a heading error psi does to the horizontal force f beyond first order.

    Along f it is (1 - cos psi) f, across f (psi - sin psi) f.  For a normal psi their mean squares are 3/4 sigma^4 and
    5/12 sigma^6; they last for a turn.  Below 5 deg they are less than 0.7 % and 0.05 % of f.
    """
    variance, down = 0.0, 0.0
    for i in range(3):
        down += down_e[i] * force_e[i]
        for j in range(3):
            variance += down_e[i] * P[TURN + i, TURN + j] * down_e[j]
    variance = min(variance, 1.0)
    along, across = 0.75 * variance**2 * TURN_S * seconds, 5.0 / 12.0 * variance**3 * TURN_S * seconds
    x, y, z = force_e[0] - down * down_e[0], force_e[1] - down * down_e[1], force_e[2] - down * down_e[2]
    level = x, y, z
    aside = down_e[1] * z - down_e[2] * y, down_e[2] * x - down_e[0] * z, down_e[0] * y - down_e[1] * x
    for i in range(3):
        for j in range(3):
            P[VEL + i, VEL + j] += along * level[i] * level[j] + across * aside[i] * aside[j]


@kernel
def _without_errors(y: Array, imu: Array, drifts: Array) -> Array:
    """Inertial samples (6,) without their estimated biases, and without scale and alignment errors that are states."""
    result = imu - y[ACCEL_BIAS:EXTRAS]
    rate = result[3:6].copy()
    for i in range(len(drifts)):
        element = int(drifts[i, 3])
        if element >= 0:
            result[3 + element // 3] -= y[EXTRAS + i] * rate[element % 3]
    return result


@kernel
def _spread_gyro_matrix(P: Array, mat_eb: Array, rate_b: Array, drifts: Array, seconds: float) -> None:
    """The turn by scale and alignment errors that are states, in a step: d(psi) = -mat_eb (gyro matrix) rate_b dt."""
    for i in range(len(drifts)):
        element, row = int(drifts[i, 3]), len(P) - len(drifts) + i
        if element < 0:
            continue
        for k in range(3):
            share = -mat_eb[k, element // 3] * rate_b[element % 3] * seconds
            for j in range(len(P)):
                P[TURN + k, j] += share * P[row, j]
            for j in range(len(P)):
                P[j, TURN + k] += share * P[j, row]


@kernel
def _add_shock_noise(P: Array, imu_start: Array, imu_end: Array, seconds: float) -> None:
    """Noise for a jump of the inertial samples, which may be a manoeuvre or a bit error."""
    for i in range(3):
        force_jump = np.abs(imu_end[i] - imu_start[i]) - SHOCK
        turn_jump = np.abs(imu_end[3 + i] - imu_start[3 + i]) - SHOCK_TURN
        if force_jump > 0.0:
            for k in range(3):  # body axes: it may be any of the three
                P[VEL + k, VEL + k] += (force_jump * seconds) ** 2
        if turn_jump > 0.0:
            for k in range(3):
                P[TURN + k, TURN + k] += (turn_jump * seconds) ** 2


@kernel
def second_derivatives(before: Array, here: Array, after: Array, last: float, following: float) -> Array:
    """Second derivatives (6,) at a sample (6,).  last, following : time from ``before`` and to ``after`` [s]"""
    result = np.empty(len(here))
    for j in range(len(here)):
        slopes = (after[j] - here[j]) / following - (here[j] - before[j]) / last
        result[j] = 2.0 * slopes / (last + following)
    return result


@kernel
def resample(times: Array, imu: Array, nodes: Array) -> tuple[Array, Array]:
    """Inertial samples at nodes, interpolated linearly, and their second derivatives between the nodes.

    times : ndarray, shape (m,)   of the samples [s]; the first one is before the nodes, or at the first node if no
            earlier one is known;  imu : (m, 6);  nodes : (k,), contain all sample times from the second on
    Returns : ndarray, shape (k, 6)       samples
              ndarray, shape (k - 1, 6)   second derivatives at the last sample before; zeros if unknown
    """
    at_nodes, bends = np.empty((len(nodes), 6)), np.zeros((len(nodes) - 1, 6))
    at = 1
    for k in range(len(nodes)):
        while at + 1 < len(times) and times[at + 1] <= nodes[k]:
            at += 1
        share = 0.0
        if at + 1 < len(times):
            last, following = times[at] - times[at - 1], times[at + 1] - times[at]
            share = (nodes[k] - times[at]) / following
            if k < len(bends) and last > 0.0:
                bends[k] = second_derivatives(imu[at - 1], imu[at], imu[at + 1], last, following)
        for j in range(6):
            at_nodes[k, j] = imu[at, j] + (share * (imu[at + 1, j] - imu[at, j]) if share > 0.0 else 0.0)
    return at_nodes, bends


@kernel
def health(y: Array, P: Array) -> tuple[bool, float, float]:
    """Whether all values are finite and no variance is negative; the height over a sphere [m]; the speed [m/s]."""
    total, sound = 0.0, True
    for i in range(len(y)):
        total += y[i]
    for i in range(len(P)):
        sound = sound and P[i, i] >= 0.0
        for j in range(len(P)):
            total += P[i, j]
    height = np.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2) - SEMI_MAJOR
    return sound and np.isfinite(total), height, np.sqrt(y[3] ** 2 + y[4] ** 2 + y[5] ** 2)


@kernel
def matrix(y: Array) -> Array:
    """mat_eb of an estimate."""
    return np.array(mat_from_quat(y[QUAT], y[QUAT + 1], y[QUAT + 2], y[QUAT + 3]))


@kernel
def geodetic(y: Array) -> Vector:
    """lat, lon [rad], alt above the ellipsoid [m] of an estimate."""
    return geodetic_from_ecef(y[0], y[1], y[2])


@kernel
def axes(lat: float, lon: float) -> Array:
    """mat_en (3, 3): north, east, down at lat, lon [rad] to e."""
    return np.array(mat_en(lat, lon))


@kernel
def _spread(P: Array, phi: Array) -> None:
    """Phi P Phi^T; phi : its first nine rows and as many columns as are not extras."""
    n, (rows, columns) = len(P), phi.shape
    moved, both = np.zeros((rows, n)), np.zeros((rows, rows))
    for i in range(rows):
        for k in range(columns):  # the innermost loops run along rows, so that they are vectorised
            for j in range(n):
                moved[i, j] += phi[i, k] * P[k, j]
    across = np.ascontiguousarray(phi.T)
    for i in range(rows):
        for k in range(columns):
            for j in range(rows):
                both[i, j] += moved[i, k] * across[k, j]
    for i in range(rows):
        for j in range(rows, n):
            P[i, j] = P[j, i] = moved[i, j]
        for j in range(i, rows):
            P[i, j] = P[j, i] = both[i, j]


@kernel
def _step_biases(y: Array, P: Array, unit: Array, seconds: float) -> None:
    for i in range(3):
        _step_gauss_markov(y, ACCEL_BIAS + i, P, ACCEL + i, unit[0, 1], 1.0 / unit[0, 2], seconds)
        _step_gauss_markov(y, GYRO_BIAS + i, P, GYRO + i, unit[1, 1], 1.0 / unit[1, 2], seconds)


@kernel
def _step_gauss_markov(y: Array, at: int, P: Array, row: int, sd: float, rate: float, seconds: float) -> None:  # noqa: PLR0917
    """One first-order Gauss-Markov error: decay and process noise."""
    keep = np.exp(-rate * seconds)
    y[at] *= keep
    for j in range(len(P)):
        P[row, j] *= keep
    for j in range(len(P)):
        P[j, row] *= keep
    P[row, row] += sd * sd * (1.0 - keep * keep)


@kernel
def fuse(x: Array, P: Array, z: Array, H: Array, R: Array) -> float:
    """A measurement z = H x + noise, one scalar after the other, in place.

    Correlated noise is whitened: with R = L L^T, L^-1 z and L^-1 H have the covariance 1.

    x : ndarray, shape (n,), zeros; becomes the estimated error;  P : (n, n)
    z : (m,);  H : (m, n);  R : (m, m), positive definite
    Returns the NIS, z^T (H P H^T + R)^-1 z: the sum of those of the scalars, each after the ones before it.
    """
    m, n = H.shape
    lower, white, rows, nis = np.zeros((m, m)), z.copy(), H.copy(), 0.0
    for i in range(m):
        for j in range(i + 1):
            total = R[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = np.sqrt(total) if i == j else total / lower[j, j]
        for j in range(i):
            white[i] -= lower[i, j] * white[j]
            for k in range(n):
                rows[i, k] -= lower[i, j] * rows[j, k]
        white[i] /= lower[i, i]
        for k in range(n):
            rows[i, k] /= lower[i, i]
        nis += update(x, P, white[i], rows[i], 1.0)
    return nis


@kernel
def update(x: Array, P: Array, z: float, h: Array, r: float) -> float:
    """One scalar z = h x + noise of variance r, in place; returns its innovation squared over the variance of that.

    x : ndarray, shape (n,)   error estimated so far in this update;  P : (n, n);  h : (n,)
    """
    return consider(x, P, z, h, r, np.ones(len(x)))


@kernel
def consider(x: Array, P: Array, z: float, h: Array, r: float, share: Array) -> float:  # noqa: PLR0917
    """``update`` with a share of the gain of each state: 1 if it is corrected, 0 if it is only considered.

    share : ndarray, shape (n,); Joseph's form holds for any gain, so P stays the covariance of the errors
    """
    n = len(x)
    g = np.zeros(n)
    for i in range(n):
        for j in range(n):
            g[i] += P[i, j] * h[j]
    s, expected = r, 0.0
    for i in range(n):
        s += h[i] * g[i]
        expected += h[i] * x[i]
    k = share * g / s
    for i in range(n):
        x[i] += k[i] * (z - expected)
        for j in range(i, n):
            P[i, j] = P[j, i] = P[i, j] - k[i] * g[j] - g[i] * k[j] + s * k[i] * k[j]
    return (z - expected) ** 2 / s


@kernel
def correct(y: Array, x: Array, extras: int) -> None:
    """Correct the estimate by the estimated error, in place.  extras : their number"""
    base = len(x) - extras
    y[0:QUAT] += x[0:TURN]
    quat_eb = (y[QUAT], y[QUAT + 1], y[QUAT + 2], y[QUAT + 3])
    w, p, q, r = quat_product(quat_from_turn(x[TURN], x[TURN + 1], x[TURN + 2]), quat_eb)
    y[QUAT], y[QUAT + 1], y[QUAT + 2], y[QUAT + 3] = normalised(w, p, q, r)
    if base == BIASED:
        y[ACCEL_BIAS:EXTRAS] += x[ACCEL:BIASED]
    if extras > 0:
        y[EXTRAS:] += x[base:]
