"""How far the surface of a layer is off the surfaces of the files that it was made from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ResamplingError:
    """The vertical distance between a layer and the bilinear surface of its files, over a sample of places.

    rms_m   : root of the mean square over places that are spread evenly over the layer [m]
    max_m   : the largest one, also at posts of the files, where the surfaces differ most [m]
    samples : places and posts that were compared; 0: none, and the error is unknown and told as 0
    """

    rms_m: float = 0.0
    max_m: float = 0.0
    samples: int = 0
