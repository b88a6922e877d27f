"""Posterior Cramer-Rao bound of the shift along a flight.

The information J of the state (``drift_model``) follows the drift and the slopes of the ground along the true track:

    J_k+1 = (F J_k^-1 F' + Q)^-1 + H' H / sd^2          H = (slope east, slope north, 1, 0, 0)

For a linear drift with Gaussian noise this is the recursion of Tichavsky, with the slopes of one track in place of
their mean over all tracks; no filter that knows the model has a smaller mean square error over many flights.

Source: Tichavsky, Muravchik, Nehorai 1998, eq. 21; Bergman 1999, section 4.3 (bound of terrain navigation).
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.nav.terrain_filters.drift_model import HEIGHT, SHIFT, STATES, DriftModel


class PosteriorBound:
    """On one flight."""

    def __init__(self, model: DriftModel) -> None:
        self._model, self._cov = model, model.start_cov

    @property
    def cov(self) -> Array:
        """Bound of the covariance of the state, shape (5, 5)."""
        return self._cov

    @property
    def shift_cov(self) -> Array:
        """Bound of the covariance of the shift, shape (2, 2) [m^2]."""
        return np.asarray(self._cov[SHIFT, SHIFT])

    def predict(self, seconds: float) -> None:
        """Time update."""
        self._cov = self._model.propagate(self._cov, seconds)

    def update(self, slope_east: float, slope_north: float, sd: float) -> None:
        """A sample.  slopes : of the ground at the true position; NaN over unknown ground changes nothing

        The covariance form of the recursion: it needs no inverse, and allows states without uncertainty.
        """
        row = np.zeros(STATES)
        row[SHIFT], row[HEIGHT] = (slope_east, slope_north), 1.0
        if not np.isfinite(row).all():
            return
        cross = self._cov @ row
        self._cov = self._cov - np.outer(cross, cross) / (row @ cross + sd**2)
        self._cov = 0.5 * (self._cov + self._cov.T)
