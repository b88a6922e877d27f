"""Flights over a map with posts of 12 m (HRTI-3).

Kim, Park, Bang 2018 state a mean RMS error below 3 m for the predicted range and above 11 m for the existing method;
their flight and sensor are not public.  Here the sensor and the flight of ``experiment`` are used.  How fast the
navigated position drifts decides on the error, so there are three increments.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from fti.study.ira_particle_filter import experiment
from fti.study.ira_particle_filter.experiment import FilterErrors, GroundModel

KIND = "fine"
#: Errors of the increments, each axis [m/sqrt(s)]: of the source; of ``fti study bound``; of a navigation-grade unit.
INCREMENTS_M = (experiment.INCREMENT_SD_M, 1.0, 0.1)
ELEVATION_SD_M = experiment.RELIEFS[KIND].elevation_sd
BELOW_SD_M = math.hypot(experiment.RADAR_NOISE_M, experiment.BARO_SD_M, ELEVATION_SD_M)
RANGE_SD_M = math.hypot(experiment.MATCHED_SD_M, ELEVATION_SD_M)
#: All assume the sigma that is drawn.
MODELS: Mapping[str, GroundModel] = MappingProxyType(
    {
        "radar": experiment.MODELS["radar"],
        "nadir": experiment.MODELS["nadir"].with_sd(BELOW_SD_M),
        "proposed": experiment.MODELS["proposed.elevation"].with_sd(RANGE_SD_M),
    }
)


def fly(seed: int) -> dict[tuple[float, str], FilterErrors]:
    """Errors of a run by increments [m/sqrt(s)] and model."""
    surfaces = experiment.make_ground(KIND, seed // experiment.RUNS_PER_GROUND)
    rng = np.random.default_rng([seed, 12])
    found = experiment.measure(surfaces.terrain, rng, ELEVATION_SD_M)
    walk = rng.standard_normal((experiment.SAMPLES, 2))
    return {
        (increment, name): experiment.track_shift(surfaces, found, experiment.drift_model(increment), walk, model)
        for increment in INCREMENTS_M
        for name, model in MODELS.items()
    }
