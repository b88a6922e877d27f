"""Quantisation of the height output of an RA-4500.

    up to [ft]   119   199   499   999   2099   above
    step  [ft]     1     2     5    20     50     100

Source: FreeFlight 84629, as Spiegel 2018 prints it in table 7.9 (first column as corrected in docs/errata.md).
Drivers import this, so it does not load numpy.
"""

from __future__ import annotations

QUANTISATION_FT = ((119, 1), (199, 2), (499, 5), (999, 20), (2099, 50), (65535, 100))


def quantisation_step_ft(height_ft: float) -> int:
    """Step of the altitude [ft] at a height [ft]."""
    for top, step in QUANTISATION_FT:
        if height_ft <= top:
            return step
    return QUANTISATION_FT[-1][1]


def quantise_ft(height_ft: float) -> int:
    """The altitude output of the instrument [ft], 0..65535."""
    step = quantisation_step_ft(max(height_ft, 0.0))
    return min(max(round(height_ft / step) * step, 0), 65535)
