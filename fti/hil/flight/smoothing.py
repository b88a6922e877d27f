"""Fits a flight to recorded samples: filters quantisation steps, then interpolates with a spline.

A recorder that stores radians in single precision moves a position at 180 deg of longitude by up to 0.76 m, in steps of
1.5 m (eq. 7.1 of the source has 0.64 m; see the errata); a spline through such steps would oscillate.

    z = argmin  sum (z - y)^2 + lambda sum (third difference of z)^2        lambda = (2 sin(pi h / period))^-6

is Whittaker's graduation: it preserves parabolas, halves the amplitude of a wave of that period, removes much faster
ones, and needs no values beyond the ends.  The filtered samples are smooth over a quarter of the period, which is the
knot interval of the spline; the samples between the knots show the error of the fit.

Source: Spiegel 2018, 7.1.1, figures 7.2 and 7.3; Whittaker 1923; Eilers 2003 (as a banded system).  Checked against:
sines and parabolas, tests/hil/flight/test_smoothing.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.geodesy.quaternions import make_continuous, mat_from_quat, quat_from_mat
from fti.geodesy.rotations import mat_from_rpy, rpy_from_mat
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.hil.flight.banded_solver import solve_banded
from fti.hil.flight.trajectory import FlightSamples, FlightState, SplineFlight, check_times

ORDER = 3
NAMES = ("t", "lat", "lon", "alt", "roll", "pitch", "heading")
KNOTS_PER_PERIOD = 4


@dataclass(frozen=True, eq=False)
class FlightFit:
    """A flight fitted to samples, and the displacement of the samples by each step.

    recorded_samples : the input
    filtered_samples : the samples after the filter; the input if none was requested
    filter_m, filter_rad : distance and angle from recorded to filtered samples, shape (n,)
    spline_m, spline_rad : distance and angle from filtered samples to the flight, at the samples that are not knots,
                           ``intermediate_t`` [s]; empty when all samples are knots
    """

    flight: SplineFlight
    recorded_samples: FlightSamples
    filtered_samples: FlightSamples
    filter_m: Array
    filter_rad: Array
    intermediate_t: Array
    spline_m: Array
    spline_rad: Array

    def error_text(self) -> str:
        """The errors as text: root mean square and maximum."""
        steps = [("filtered minus recorded", self.filter_m, self.filter_rad)]
        if len(self.spline_m):
            steps.append(("spline minus filtered", self.spline_m, self.spline_rad))
        return "; ".join(f"{name}: {_error_text(metres, angles)}" for name, metres, angles in steps)


def fit(samples: FlightSamples, period: float | None) -> FlightFit:
    """Fit a flight to samples.  period : the filter removes faster oscillations [s]; None: no filter.

    Raises ValueError for gaps, for times that do not increase, and for fewer than six samples or knots.
    """
    check_times(samples.t)
    if period is None:
        filtered_samples, knots = samples, np.arange(len(samples.t))
    else:
        filtered_samples = smooth(samples, period)
        intervals = np.floor((samples.t - samples.t[0]) / (period / KNOTS_PER_PERIOD) + 1e-6)
        knots = np.unique(intervals, return_index=True)[1]  # the first sample in each interval
    flight = SplineFlight.from_samples(_select_rows(filtered_samples, knots))
    intermediate = _select_rows(filtered_samples, np.setdiff1d(np.flatnonzero(filtered_samples.t <= flight.end), knots))
    splined = displacements(intermediate, flight.state(intermediate.t))
    filtered = displacements(samples, filtered_samples)
    return FlightFit(flight, samples, filtered_samples, *filtered, intermediate.t, *splined)


def smooth(samples: FlightSamples, period: float) -> FlightSamples:
    """The samples without oscillations faster than a period [s]; the wind is not filtered."""
    positions_e = ecef_from_geodetic(samples.lat, samples.lon, samples.alt)
    lat, lon, alt = geodetic_from_ecef(positions_e[0] + graduate(samples.t, positions_e - positions_e[0], period))
    quats = graduate(samples.t, make_continuous(quat_from_mat(_attitude(samples))), period)
    roll, pitch, heading = rpy_from_mat(mat_from_quat(quats / np.linalg.norm(quats, axis=1, keepdims=True)))
    return replace(samples, lat=lat, lon=lon, alt=alt, roll=roll, pitch=pitch, heading=heading)


def graduate(t: Array, values: Array, period: float) -> Array:
    """Whittaker's graduation of values, shape (n, d), at t, shape (n,) [s], increasing; gain 0.5 at ``period`` [s].

    Divided differences allow unequal steps.  Raises ValueError for a period of at most two steps: such waves are
    aliases of others.
    """
    step = float(np.median(np.diff(t)))
    if period <= 2.0 * step:
        raise ValueError(
            f"samples {step:.3f} s apart cannot be smoothed over {period:.3f} s; use more than twice the interval"
        )
    weight = (2.0 * np.sin(np.pi * step / period)) ** (-2 * ORDER)
    rows = _third_differences(t, step)
    m = len(rows)
    band = np.zeros((len(t), 2 * ORDER + 1))
    band[:, ORDER] = 1.0
    rough = sum(rows[:, a, None] * values[a : a + m] for a in range(ORDER + 1))
    right = np.zeros_like(values)
    for a in range(ORDER + 1):
        right[a : a + m] += weight * rows[:, a, None] * rough
        for b in range(ORDER + 1):
            band[a : a + m, ORDER + b - a] += weight * rows[:, a] * rows[:, b]
    return np.asarray(values - solve_banded(band, right))  # solving for the small correction keeps precision


def _third_differences(t: Array, step: float) -> Array:
    """Weights of t[i] to t[i + 3] in the third difference, row i, shape (n - 3, 4); -1 3 -3 1 for equal steps."""
    times = np.stack([t[a : len(t) - ORDER + a] for a in range(ORDER + 1)], axis=1) / step
    apart = times[:, :, None] - times[:, None, :] + np.eye(ORDER + 1)
    return np.asarray(6.0 / np.prod(apart, axis=2))


def displacements(before: FlightSamples, after: FlightSamples | FlightState) -> tuple[Array, Array]:
    """Distance [m] and angle [rad] from one flight to another at the same times, shape (n,) each."""
    here, there = (ecef_from_geodetic(s.lat, s.lon, s.alt) for s in (before, after))
    return np.linalg.norm(there - here, axis=1), angle_between(_attitude(before), _attitude(after))


def angle_between(mats: Array, others: Array) -> Array:
    """Angle of rotation from one attitude to another [rad], shape (n,); accurate for small angles."""
    turned = np.swapaxes(mats, 1, 2) @ others
    skew = turned - np.swapaxes(turned, 1, 2)
    sines = np.linalg.norm(np.stack((skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0])), axis=0)
    return np.asarray(np.arctan2(sines, np.einsum("nii->n", turned) - 1.0))


def _attitude(of: FlightSamples | FlightState) -> Array:
    return mat_from_rpy(of.roll, of.pitch, of.heading)


def _select_rows(samples: FlightSamples, rows: NDArray[np.intp]) -> FlightSamples:
    t, lat, lon, alt, roll, pitch, heading = (np.asarray(getattr(samples, name))[rows] for name in NAMES)
    wind_n = samples.wind_n if isinstance(samples.wind_n, tuple) else samples.wind_n[rows]
    return FlightSamples(t, lat, lon, alt, roll, pitch, heading, wind_n)


def _error_text(metres: Array, angles: Array) -> str:
    deg = np.rad2deg(angles)
    rms_m, rms_deg = (float(np.sqrt(np.mean(np.square(values)))) for values in (metres, deg))
    return f"{rms_m:.2g} m and {rms_deg:.2g} deg rms, at most {metres.max():.2g} m and {deg.max():.2g} deg"
