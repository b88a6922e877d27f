"""Compilation of the loops of geodesy before live use."""

from __future__ import annotations

import numpy as np

from fti.geodesy.gravity import normal_gravity
from fti.geodesy.local import LocalFrame
from fti.geodesy.quaternions import mat_from_quat, quat_from_mat
from fti.geodesy.rotations import mat_from_rpy, rpy_from_mat
from fti.geodesy.wgs84 import radii


def warm_up() -> None:
    """Compile the loops, or load them from the cache; ``quaternions.all_quats`` is the last one."""
    place = LocalFrame(0.0, 0.0, 0.0).to_geodetic(np.zeros(3))
    radii(0.0)
    normal_gravity(0.0, 0.0)
    rpy_from_mat(mat_from_rpy(*place))
    quat_from_mat(mat_from_quat((1.0, 0.0, 0.0, 0.0)))
