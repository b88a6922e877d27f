"""Difference between the surface of a layer and the surfaces of its files."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ResamplingError:
    """The vertical distance between a layer and the bilinear surface of its files, over a sample of points.

    rms_m   : root mean square over points that are spread evenly over the layer [m]
    max_m   : maximum, also at posts of the files, where the surfaces differ most [m]
    samples : number of compared points and posts; 0: the error is unknown and given as 0
    """

    rms_m: float = 0.0
    max_m: float = 0.0
    samples: int = 0
