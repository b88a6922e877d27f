"""Particle filter (SIR): the probability of the shift by particles; each has mean and variance of the height error.

    start               particles on a spiral, more dense in the middle
    time update         each particle moves by the drift of the model
    measurement update  likelihood of a sample at each particle; the height error is updated exactly
    resampling          when fewer than half of the particles count

A particle stands for an area of the shift.  The likelihood contains the height that the slope of the ground changes
within this area; particles that are drawn from one share its area, and are moved within it where the ground leaves it
undetermined.  The first samples after the start are much more accurate than the distance between particles: without
the area all but some of them would have no probability.  When the cloud has converged, the area is less than the drift.

A cloud that covers less area needs fewer particles: one for each area of ``fine_m``, at least ``min_particles``.

The measurement is exchangeable: ``update`` takes a sample of a surface, which is the ground or a map of predicted
ranges (navigated height minus range); ``weigh`` takes the predicted measurement of each particle.

Source: Arulampalam et al. 2002 (SIR); Musso, Oudjane, LeGland 2001 (regularised particle filter); Park et al. 2017,
section III (terrain).
"""

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array
from fti.nav.terrain_filters import particle_kernels as particle
from fti.nav.terrain_filters.drift_model import DriftModel, ShiftEstimate
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_filters.particle_drawing import draw_particles, shift_moments
from fti.nav.terrain_filters.point_mass import GridCells
from fti.nav.terrain_matching.window import TerrainWindow

#: Least number of particles.
MIN_PARTICLES = 1000
#: Share of the particles that must count; below, new ones are drawn.
MIN_COUNTING = 0.5
#: Area of a Gaussian of covariance C: this times sqrt(det C) (exponential of its entropy).
GAUSSIAN_AREA = 2.0 * math.pi * math.e
#: Least area of a cloud over that of the Gaussian with its covariance: clouds with several narrow modes have less.
MIN_AREA_SHARE = 0.1
#: One sigma of the particles at the start over that of the position: some begin where its probability is small.
START_WIDTH = 1.4


class ParticleFilter:
    """On one flight.

    cells : start from these; None: from the errors of the model;  seed : of the random numbers
    Raises ValueError for a model with a velocity error: see ``MarginalisedFilter``.
    """

    #: Their number when the cloud covers little; a larger cloud has one for each area of this side [m].
    min_particles, fine_m = MIN_PARTICLES, 4.0

    def __init__(
        self, model: DriftModel, particles: int = MIN_PARTICLES, seed: int = 0, cells: GridCells | None = None
    ) -> None:
        if model.has_velocity:
            raise ValueError(f"{model}: the SIR filter has no velocity error")
        self._begin(model, seed, on_spiral(model, particles) if cells is None else _in_cells(cells, particles))

    def _begin(self, model: DriftModel, seed: int, cloud: Array) -> None:
        self._model, self._cloud, self._spare = model, cloud, np.empty_like(cloud)
        self._seed = np.array([seed], dtype=np.uint64)
        self._residual_2 = math.nan

    @property
    def particles(self) -> int:
        """Their number."""
        return int(self._cloud.shape[1])

    @property
    def shifts(self) -> Array:
        """Shift of each particle, east and north, shape (2, particles) [m]."""
        return self._cloud[particle.EAST : particle.NORTH + 1].copy()

    @property
    def residual_2(self) -> float:
        """Residual^2 over variance of the last sample as the cloud predicted it; NaN over unknown ground."""
        return self._residual_2

    def predict(self, seconds: float) -> None:
        """Time update."""
        self._drift(seconds, self._model.position_walk * math.sqrt(seconds))

    def update(self, window: TerrainWindow, sample: HeightSample) -> None:
        """Measurement update; a sample without known ground changes nothing."""
        column = (sample.east - window.east0) / window.cell_m
        row = (sample.north - window.north0) / window.cell_m
        particle.predict_heights(self._cloud, window.heights, column, row, window.cell_m, sample.ground)
        self._update(sample.sd, 1.0)

    def weigh(self, predicted: Array, measured: float, sd: float, per_height: float = 1.0) -> None:
        """Measurement update with the measurement that each particle predicts without a height error.

        predicted  : at each of ``shifts``, shape (particles,); NaN where unknown
        measured   : the measurement;  sd : one sigma of its independent error
        per_height : its change with the height error (navigated minus true): 1 for a height of the ground
        """
        cloud = self._cloud
        cloud[particle.RESIDUAL] = measured - predicted - per_height * cloud[particle.MEAN]
        cloud[particle.SLOPE_EAST] = cloud[particle.SLOPE_NORTH] = 0.0
        self._update(sd, per_height)

    def correct(self, east: float, north: float) -> None:
        """The navigated position was changed by this [m]."""
        self._cloud[particle.EAST] -= east
        self._cloud[particle.NORTH] -= north

    def estimate(self) -> ShiftEstimate:
        """Mean and covariance."""
        cloud, probability = self._cloud, self._cloud[particle.PROBABILITY]
        east, north, east_2, north_2, across = shift_moments(cloud)
        own = particle.SQUARE * float(probability @ cloud[particle.AREA])
        height = float(probability @ cloud[particle.MEAN])
        variance = float(probability @ (cloud[particle.VARIANCE] + (cloud[particle.MEAN] - height) ** 2))
        cov = np.array([[east_2 + own, across], [across, north_2 + own]])
        return ShiftEstimate(np.array([east, north]), cov, height, math.sqrt(variance))

    def _drift(self, seconds: float, sd: float) -> None:
        height_variance = self._model.height_walk**2 * seconds
        particle.drift_particles(self._cloud, particle.normal_pairs(), self._seed, sd, height_variance)

    def _update(self, sd: float, per_height: float) -> None:
        counting, covered, self._residual_2 = particle.weigh_particles(self._cloud, sd**2, per_height)
        if counting < MIN_COUNTING * self.particles:
            self._draw(covered)

    def _draw(self, covered: float) -> None:
        """Draw new particles, as many as the covered area [m^2] needs."""
        number = min(max(math.ceil(covered / self.fine_m**2), self.min_particles), self.particles)
        if number < self.particles:
            self._spare = np.empty((particle.ROWS, number))
        draw_particles(self._cloud, self._spare, particle.normal_pairs(), self._seed, self._model.has_velocity)
        self._cloud, self._spare = self._spare, self._cloud[:, :number]
        _, _, east_2, north_2, across = shift_moments(self._cloud)
        area = GAUSSIAN_AREA * math.sqrt(max(east_2 * north_2 - across**2, 0.0))
        areas = self._cloud[particle.AREA]
        np.maximum(areas, MIN_AREA_SHARE * area / number, out=areas)


def on_spiral(model: DriftModel, count: int) -> Array:
    """A cloud of the start of a model: particles wider than the position, with its probability."""
    turn = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    squared = -2.0 * np.log1p(-(np.arange(count) + 0.5) / count)  # of the radius, standard normal
    cloud, width_2 = np.zeros((particle.ROWS, count)), (START_WIDTH * model.position_sd) ** 2
    radius = np.sqrt(width_2 * squared)
    cloud[particle.EAST], cloud[particle.NORTH] = radius * np.cos(turn), radius * np.sin(turn)
    cloud[particle.VARIANCE] = model.height_sd**2
    cloud[particle.AREA] = math.tau * width_2 / count * np.exp(0.5 * squared)
    probability = np.exp(-0.5 * squared * (START_WIDTH**2 - 1.0))
    cloud[particle.PROBABILITY] = probability / probability.sum()
    return cloud


def _in_cells(cells: GridCells, count: int) -> Array:
    """A cloud of equal probabilities, drawn from cells; the particles of a cell share its area."""
    places = (np.arange(count) + 0.5) / count
    cell = np.minimum(np.searchsorted(np.cumsum(cells.probability), places), len(cells.probability) - 1)
    within = cells.side * (np.random.default_rng(count).random((2, count)) - 0.5)
    cloud = np.zeros((particle.ROWS, count))
    cloud[particle.EAST], cloud[particle.NORTH] = cells.east[cell] + within[0], cells.north[cell] + within[1]
    cloud[particle.MEAN], cloud[particle.VARIANCE] = cells.mean[cell], cells.variance[cell]
    cloud[particle.AREA] = cells.side**2 / np.maximum(count * cells.probability[cell], 1.0)
    cloud[particle.PROBABILITY] = 1.0 / count
    return cloud
