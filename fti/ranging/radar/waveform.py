"""The transmitted signal of a frequency-modulated continuous-wave (FMCW) radar, and its mixer products.

A saw tooth: from the carrier f_c the frequency rises by delta_f in delta_t, then restarts.

    f_tx(t) = f_c + f' u,    f' = delta_f / delta_t,    u = t mod delta_t                      (2.7, 2.8)
    phase   = 2 pi (f_c t + f' u^2 / 2 + k f' delta_t^2 / 2),    k = floor(t / delta_t)        [rad], continuous

The phase is the integral of the frequency.  The product 2 pi f_tx(t) t, as printed in 2.6, sweeps at twice the rate,
and a delay in it doubles the beat.  A power P is an amplitude of sqrt(P).

An echo of the delay tau makes the beat f_tx(t) - f_tx(t - tau) (2.80): f' tau, or, while the echo still belongs to the
ramp before (0 <= u < tau, the slip), f' tau - delta_f; a receiver sees the absolute value delta_f - f' tau.

Source: Spiegel 2018, sections 2.1.3.1, 2.1.3.4, 2.2.6 and 2.2.7; errata 2.6, 2.10, 2.72, 2.75, 2.82.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.constants import SPEED_OF_LIGHT


@dataclass(frozen=True, slots=True)
class Waveform:
    """A saw tooth: carrier f_c [Hz], bandwidth delta_f [Hz], duration of a ramp delta_t [s].

    The defaults are those of section 2.2.6: 4.3 GHz, 300 MHz in 100 us (3.0e12 Hz/s; erratum 2.72).
    Raises ValueError where one is not positive and finite.
    """

    f_c: float = 4.3e9
    delta_f: float = 300e6
    delta_t: float = 100e-6

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{field.name} is {value}, must be positive and finite")

    @property
    def slope(self) -> float:
        """f' [Hz/s] (2.7)."""
        return self.delta_f / self.delta_t

    @property
    def wavelength(self) -> float:
        """Of the carrier [m]."""
        return SPEED_OF_LIGHT / self.f_c

    @property
    def range_bin(self) -> float:
        """Range of one bin of a spectrum over a whole ramp, c / (2 delta_f) [m]."""
        return SPEED_OF_LIGHT / (2.0 * self.delta_f)

    @property
    def unambiguous_range(self) -> float:
        """c delta_t / 2 [m]: an echo from there is late by a whole ramp."""
        return 0.5 * SPEED_OF_LIGHT * self.delta_t

    def beat(self, delay: ArrayLike) -> Array:
        """Beat frequency f' tau [Hz] of a delay [s] (2.80)."""
        return np.asarray(self.slope * np.asarray(delay, dtype=np.float64))

    def slip_beat(self, delay: ArrayLike) -> Array:
        """Beat frequency delta_f - f' tau [Hz] during the first tau of a ramp (2.82, sign corrected)."""
        return self.delta_f - self.beat(delay)

    def delay_of_beat(self, beat: ArrayLike) -> Array:
        """Delay [s] that makes a beat frequency [Hz] (2.32)."""
        return np.asarray(np.asarray(beat, dtype=np.float64) / self.slope)

    def range_of_beat(self, beat: ArrayLike) -> Array:
        """Range [m] that makes a beat frequency [Hz] (2.33)."""
        return range_of_delay(self.delay_of_beat(beat))

    def bin_of_range(self, slant_range: ArrayLike) -> Array:
        """Position of a range [m] in a spectrum over a whole ramp: bins, not rounded."""
        return np.asarray(np.asarray(slant_range, dtype=np.float64) / self.range_bin)

    def range_of_bin(self, position: ArrayLike) -> Array:
        """Range [m] of a position in the spectrum [bins]."""
        return np.asarray(np.asarray(position, dtype=np.float64) * self.range_bin)

    def frequency(self, t: ArrayLike) -> Array:
        """Transmitted frequency [Hz] at the times t [s] (2.8)."""
        return np.asarray(self.f_c + self.slope * np.mod(t, self.delta_t))

    def cycles(self, t: ArrayLike) -> Array:
        """Transmitted phase [cycles] at the times t [s]; t = 0 is the begin of a ramp, with a signal before."""
        time = np.asarray(t, dtype=np.float64)
        ramp = np.floor(time / self.delta_t)
        into = time - ramp * self.delta_t
        return np.asarray(self.f_c * time + 0.5 * self.slope * (into**2 + ramp * self.delta_t**2))

    def phase(self, t: ArrayLike) -> Array:
        """Transmitted phase [rad] in [0, 2 pi)."""
        return np.asarray(2.0 * np.pi * np.mod(self.cycles(t), 1.0))

    def transmitted(self, t: ArrayLike, power: float = 1.0) -> Array:
        """The transmitted signal sqrt(power) cos(phase) (2.6 as corrected)."""
        return np.asarray(np.sqrt(power) * np.cos(self.phase(t)))


#: Carrier of table 2.8.  The source gives no sweep for it; that of the 4.3 GHz radar is used.
WAVEFORM_24_GHZ = Waveform(f_c=24.125e9)


def delay_of_range(slant_range: ArrayLike) -> Array:
    """Two-way travel time [s] of a range [m]."""
    return np.asarray(2.0 * np.asarray(slant_range, dtype=np.float64) / SPEED_OF_LIGHT)


def range_of_delay(delay: ArrayLike) -> Array:
    """Range [m] of a two-way travel time [s] (2.33)."""
    return np.asarray(0.5 * SPEED_OF_LIGHT * np.asarray(delay, dtype=np.float64))


class LoatPlan(NamedTuple):
    """Frequencies [Hz] in a receiver with local oscillator automatic tuning; of each mixer (sum, difference)."""

    lo: float  #: local oscillator (2.20)
    tx_if: tuple[float, float]  #: transmitted signal mixed with it (2.21, 2.70)
    rx_if: tuple[float, float]  #: received signal mixed with it (2.22, 2.69)
    trx: tuple[float, float]  #: the low-pass filtered ones mixed (2.26, 2.71)


class SsbPlan(NamedTuple):
    """Frequencies [Hz] in a single-sideband receiver; of each mixer (sum, difference)."""

    tx_lo: tuple[float, float]  #: transmitted signal mixed with the local oscillator (2.27, 2.75)
    trx: tuple[float, float]  #: received signal mixed with the lower sideband (2.29, 2.76)
    trx_lo: tuple[float, float, float, float]  #: its product with the local oscillator (2.31, 2.77)


def loat_plan(f_tx: float, beat: float, f_if: float = 200e6) -> LoatPlan:
    """Frequencies for a transmitted f_tx and an echo that is ``beat`` lower [Hz]."""
    f_lo, f_rx = f_tx - f_if, f_tx - beat
    low = f_rx - f_lo
    return LoatPlan(f_lo, (f_tx + f_lo, f_if), (f_rx + f_lo, low), (f_if + low, f_if - low))


def ssb_plan(f_tx: float, beat: float, f_lo: float = 500e6) -> SsbPlan:
    """Frequencies for a transmitted f_tx and an echo that is ``beat`` lower [Hz]."""
    f_rx, sideband = f_tx - beat, f_tx - f_lo
    high, low = f_rx + sideband, f_rx - sideband
    return SsbPlan((f_tx + f_lo, sideband), (high, low), (high + f_lo, high - f_lo, low + f_lo, abs(low - f_lo)))
