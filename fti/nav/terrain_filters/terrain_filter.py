"""The terrain filter of a flight: its form follows the uncertainty of the position, and it starts again when lost.

    position within 300 m (95 %)    particles, 1,000
    within 1 km                     particles, 20,000 until few modes are left
    beyond                          point-mass filter; particles as soon as the position is within 1 km

A model with a velocity error has no place on the grid of the point-mass filter: then there are 5,000 and 40,000
particles, and beyond 1 km as many for each area as within.  A filter that is lost (``recovery``) is replaced by one
that starts from the navigated position with the uncertainty that it has without samples.
"""

from __future__ import annotations

import math

import numpy as np

from fti.nav.terrain_filters.drift_model import DriftModel, ShiftEstimate
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_filters.marginalised import MarginalisedFilter
from fti.nav.terrain_filters.point_mass import PointMassFilter
from fti.nav.terrain_filters.recovery import ResidualTest
from fti.nav.terrain_filters.sir import ParticleFilter
from fti.nav.terrain_matching.window import TerrainWindow

#: 95 % of the positions are within this number of sigmas in two dimensions.
WITHIN_SIGMAS = math.sqrt(-2.0 * math.log(0.05))
#: Particles for a position within a distance [m].
NEAR_M, NEAR_PARTICLES = 300.0, 1000
FAR_M, FAR_PARTICLES = 1000.0, 20_000
#: The same of a model with a velocity error.
NEAR_MARGINALISED, FAR_MARGINALISED = 5000, 40_000
MAX_PARTICLES = 500_000


class TerrainFilter:
    """On one flight.  seed : of the random numbers of the particles"""

    def __init__(self, model: DriftModel, seed: int = 0) -> None:
        self._model, self._seed = model, seed
        self._age_s, self._restarts = 0.0, 0
        self._test, self._corrected = ResidualTest(), np.zeros(2)
        self._form = make_filter(model, seed)

    @property
    def restarts(self) -> int:
        """How often it was lost."""
        return self._restarts

    @property
    def particles(self) -> int:
        """Their number; 0 while the form is the point-mass filter."""
        return self._form.particles if isinstance(self._form, ParticleFilter) else 0

    def predict(self, seconds: float) -> None:
        """Time update."""
        self._age_s += seconds
        self._form.predict(seconds)

    def update(self, window: TerrainWindow, sample: HeightSample) -> None:
        """Measurement update; a sample without known ground changes nothing."""
        self._form.update(window, sample)
        if self._test.add(self._form.residual_2):
            self._restart()
        elif isinstance(self._form, PointMassFilter):
            self._leave_grid(self._form)

    def correct(self, east: float, north: float) -> None:
        """The navigated position was changed by this [m]."""
        self._form.correct(east, north)
        self._corrected += (east, north)

    def estimate(self) -> ShiftEstimate:
        """Mean and covariance."""
        return self._form.estimate()

    def _leave_grid(self, form: PointMassFilter) -> None:
        if form.is_within(FAR_M):
            self._form = ParticleFilter(self._model, FAR_PARTICLES, self._seed, form.cells)

    def _restart(self) -> None:
        self._restarts += 1
        self._test.clear()
        self._form = make_filter(self._model.after(self._age_s), self._seed + self._restarts)
        self._form.correct(*self._corrected.tolist())


def make_filter(model: DriftModel, seed: int = 0) -> ParticleFilter | PointMassFilter:
    """The form for the uncertainty of the start."""
    within_m = WITHIN_SIGMAS * model.position_sd
    if within_m > FAR_M and not model.has_velocity:
        return PointMassFilter(model)
    form, near, far = (
        (MarginalisedFilter, NEAR_MARGINALISED, FAR_MARGINALISED)
        if model.has_velocity
        else (ParticleFilter, NEAR_PARTICLES, FAR_PARTICLES)
    )
    number = near if within_m <= NEAR_M else math.ceil(far * max(within_m / FAR_M, 1.0) ** 2)
    return form(model, min(number, MAX_PARTICLES), seed)
