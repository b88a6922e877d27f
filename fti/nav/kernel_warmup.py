"""Compiles all kernels that a configuration needs, before live operation."""

from __future__ import annotations

import numpy as np

from fti.config import Config
from fti.geodesy.gravity import normal_gravity
from fti.geodesy.local import LocalFrame
from fti.geodesy.quaternions import mat_from_quat, quat_from_mat
from fti.geodesy.rotations import mat_from_rpy, rpy_from_mat
from fti.geodesy.wgs84 import radii
from fti.nav import look_pairs, terrain_methods
from fti.nav.altimetry import expected_range
from fti.nav.filter.navigator import warm_up as warm_up_filter
from fti.nav.integrity import statistics, window
from fti.nav.terrain_reference import Ground


def warm_up(config: Config, ground: Ground | None) -> None:
    """Compile the kernels, or load them from the cache (seconds on the first start)."""
    _warm_up_geodesy()
    if config.nav.approach:
        statistics.warm_up()
        window.warm_up()
    if config.nav.filter:
        warm_up_filter()
    if config.nav.scan_drift:
        look_pairs.warm_up()
    if config.nav.terrain_position:
        terrain_methods.warm_up()
    for name in config.nav.altimeters:
        device = config.find_device(name)
        if device and ground:
            expected_range.warm_up(device, ground)


def _warm_up_geodesy() -> None:
    """``quaternions.all_quats`` is the last one."""
    place = LocalFrame(0.0, 0.0, 0.0).to_geodetic(np.zeros(3))
    radii(0.0)
    normal_gravity(0.0, 0.0)
    rpy_from_mat(mat_from_rpy(*place))
    quat_from_mat(mat_from_quat((1.0, 0.0, 0.0, 0.0)))
