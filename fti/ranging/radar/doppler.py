"""Doppler shift of an FMCW radar altimeter, and its range error.

    f_d   = -2 rho' f_c / c                     shift of the received frequency [Hz]; 2.34 prints a one-way path
    d rho = -f_d c / (2 f') = rho' f_c / f'     error of the measured range [m] (2.35)

rho' is the rate of the range [m/s], positive when it grows.  An approaching ground shifts the echo up, which lowers the
beat: the measured range is short.  A rising saw tooth cannot separate the two.  f_c is the begin of the ramp; on
average the carrier is delta_f / 2 higher and the error, of the range at the middle of the ramp, 3.5 % larger.
Source: Spiegel 2018, section 2.1.3.4, fig. 2.13.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.constants import SPEED_OF_LIGHT
from fti.ranging.radar.waveform import Waveform


def doppler_shift(range_rate: ArrayLike, f_c: float) -> Array:
    """Shift [Hz] of the received frequency, of a carrier f_c [Hz] and a rate of the range [m/s]."""
    return np.asarray(-2.0 * f_c / SPEED_OF_LIGHT * np.asarray(range_rate, dtype=np.float64))


def range_error(range_rate: ArrayLike, waveform: Waveform) -> Array:
    """Measured minus true range [m] (2.35) of a rate of the range [m/s]."""
    return np.asarray(waveform.f_c / waveform.slope * np.asarray(range_rate, dtype=np.float64))
