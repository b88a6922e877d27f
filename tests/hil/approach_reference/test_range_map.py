"""Looked-up ranges against traced ones."""

import dataclasses

import numpy as np
import pytest

from fti.hil.approach_reference.approaches import RA4500, TerrainGround, simulate
from fti.hil.approach_reference.range_map import map_ground
from fti.nav.integrity.approach import ApproachPath, load_airfield
from fti.terrain.demo_scene import DEMO_AIRFIELD, demo_scene

S_MAX = 2500.0


@pytest.fixture(scope="module")
def ground() -> TerrainGround:
    """An instrument without noise and steps, so that only the ground differs."""
    airfield = load_airfield(DEMO_AIRFIELD.read_text(), str(DEMO_AIRFIELD))
    exact = dataclasses.replace(RA4500, noise_sd=0.0, step=lambda height: np.full(np.shape(height), 1e-6))
    return TerrainGround(ApproachPath(airfield), exact, (demo_scene(),))


def test_a_looked_up_approach_is_a_traced_one_within_three_quarters_of_a_metre(ground: TerrainGround) -> None:
    """RMS of 5 approaches over ridges and woods, the noise of the instrument left out; the mean within 0.3 m.

    Tracing refines the nearest ray, the lattice does not: little beside a sigma of 3 m of the profile.
    """
    mapped = map_ground(ground, S_MAX, lambda share: None)
    errors = []
    for run in range(5):
        traced, looked_up = (simulate(g, S_MAX, np.random.default_rng([4, run])) for g in (ground, mapped))
        assert len(traced.agl) == len(looked_up.agl)
        errors.append(looked_up.agl - traced.agl)
    error = np.concatenate(errors)
    assert np.sqrt(np.mean(error**2)) < 0.75
    assert abs(error.mean()) < 0.3


def test_progress_is_reported_for_each_terrain(ground: TerrainGround) -> None:
    shares: list[float] = []
    two = dataclasses.replace(ground, terrains=ground.terrains * 2)
    assert len(map_ground(two, 300.0, shares.append).lattices) == 2
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
