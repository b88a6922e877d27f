"""Baseband after the last mixer of a receiver: the beat signal of many rays and its spectrum.

Every ray n of the delay tau_n and the power P_n (over the transmitted one) is a tone (2.80, 2.81 as corrected)

    s(t) = sum_n sqrt(P_n) cos(2 pi (f' tau_n + f_d,n) t + psi_n),    psi_n = 2 pi (f_c tau_n - f' tau_n^2 / 2) - phi_n

with the phase phi_n of the scatterer and the Doppler shift f_d,n.  For t < tau_n the echo is still that of the ramp
before: its tone is delta_f - f' tau_n (2.82 and 2.83, sign corrected), which the low-pass filter removes unless the
band includes it.  2.81 as printed has no psi_n: all rays are then in phase, and there is no speckle.

Coherent: the power of one spectrum of s over a ramp, Hann window.  Incoherent: its mean over random phases phi_n, which
is the sum of the rays' powers, each spread by the window's kernel, and the limit of the average of many ramps.

Spectra are powers over the transmitted one, per range bin (``Waveform.range_bin``); a lone ray of the power P in the
middle of a bin reads P there.  Source: Spiegel 2018, section 2.2.7; Harris 1978 for the window.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.ranging.radar.doppler import doppler_shift
from fti.ranging.radar.waveform import Waveform, delay_of_range

KERNEL_BINS = 8  #: the kernel is truncated beyond: -65 dB there, -60 dB of the total power
PASS_SHARE = 0.8  #: passband as a share of half the sampling rate; the transition ends at half the rate
BOLTZMANN = 1.380649e-23


def hann_kernel(offset: ArrayLike) -> Array:
    """Power of a tone in a bin ``offset`` bins away, 1 at 0: (sin(pi x) / (pi x (1 - x^2)))^2.

    Valid for continuous time.  The error against the discrete transform of 4096 samples is below 1e-9 within +-8 bins,
    averaged over the phase of the tone and from bin 16 on; nearer, the image of the tone adds to it.
    """
    return np.asarray(hann_power(np.asarray(offset, dtype=np.float64)))


def hann_power(offset: Any) -> Any:
    """``hann_kernel`` for kernels: of a float or an array.

    A Hann window is a rectangle's kernel and, half as high, that of either side.
    """
    return (np.sinc(offset) + 0.5 * (np.sinc(offset - 1.0) + np.sinc(offset + 1.0))) ** 2


def lowpass(frequency: ArrayLike, last_passed: float, first_stopped: float) -> Array:
    """Amplitude response of a low-pass filter: 1, half a cosine down, 0 [Hz]."""
    share = (np.abs(frequency) - last_passed) / (first_stopped - last_passed)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.clip(share, 0.0, 1.0)))


def thermal_noise(waveform: Waveform, transmit_power: float, noise_factor: float, temperature: float = 290.0) -> float:
    """Power of the receiver's noise in one bin over the transmitted power: k T F (3/2) / (delta_t P_tx).

    transmit_power [W], noise_factor (1 or more, not decibels), temperature [K]; 3/2 bins is the Hann window's
    bandwidth.
    """
    return 1.5 * BOLTZMANN * temperature * noise_factor / (waveform.delta_t * transmit_power)


@dataclass(frozen=True, slots=True)
class Baseband:
    """Beat signals and their spectra over one ramp; n_sample : samples in a ramp, even.

    4096 samples in 100 us are 41 MHz: 1638 bins, or 818 m at 300 MHz of bandwidth.
    """

    waveform: Waveform = field(default_factory=Waveform)
    n_sample: int = 4096

    def __post_init__(self) -> None:
        if self.n_sample < 32 or self.n_sample % 2:
            raise ValueError(f"n_sample is {self.n_sample}, must be even and at least 32")

    @classmethod
    def reaching(cls, max_range: float, waveform: Waveform | None = None) -> Baseband:
        """The baseband with the smallest power of two of samples that passes echoes from ``max_range`` [m] unchanged.

        Raises ValueError for a range that is not positive or beyond the unambiguous one.
        """
        shape = Waveform() if waveform is None else waveform
        if not 0.0 < max_range <= shape.unambiguous_range:
            raise ValueError(
                f"max_range is {max_range} m, must be positive and at most {shape.unambiguous_range:.0f} m"
            )
        needed = 2.0 / PASS_SHARE * (float(shape.bin_of_range(max_range)) + KERNEL_BINS)
        return cls(shape, 1 << int(np.ceil(np.log2(needed))))

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""
        return self.n_sample / self.waveform.delta_t

    @property
    def n_bin(self) -> int:
        """Bins of a spectrum: those that the filter passes unchanged."""
        return int(0.5 * PASS_SHARE * self.n_sample)

    @property
    def ranges(self) -> Array:
        """Range [m] of the middle of each bin, shape (n_bin,)."""
        return self.waveform.range_of_bin(np.arange(self.n_bin))

    def response(self, frequency: ArrayLike) -> Array:
        """Amplitude response of the filter in front of the samples."""
        return lowpass(frequency, 0.5 * PASS_SHARE * self.rate, 0.5 * self.rate)

    def beat_signal(
        self, ranges: ArrayLike, powers: ArrayLike, phases: ArrayLike = 0.0, range_rates: ArrayLike = 0.0
    ) -> Array:
        """The beat signal of a ramp, shape (n_sample,), at the times k delta_t / n_sample.

        ranges      : (n_ray,) [m]    NaN where a ray met nothing
        powers      : (n_ray,)        received over transmitted power; NaN is none
        phases      : phi_n [rad], range_rates: [m/s] growing; floats or (n_ray,)
        Raises ValueError for a range that is negative or beyond the unambiguous one.
        """
        delay, amplitude, phase, doppler = self._echoes(ranges, powers, phases, range_rates)
        tone = self.waveform.beat(delay) + doppler
        start = self.waveform.f_c * delay - 0.5 * self.waveform.slope * delay**2 - phase / (2.0 * np.pi)
        passed = amplitude * self.response(tone)
        signal = _sum_of_tones(passed, start, tone / self.rate, self.n_sample)
        late = np.arange(min(self.n_sample, int(np.ceil(np.max(delay, initial=0.0) * self.rate))))
        sample, ray = np.nonzero(late[:, None] / self.rate < delay)
        before = passed[ray] * np.cos(2.0 * np.pi * (start[ray] + tone[ray] / self.rate * sample))
        signal[: len(late)] -= np.bincount(sample, before, len(late))
        self._add_slip(signal, delay, amplitude, phase, doppler)
        return signal

    def _add_slip(self, signal: Array, delay: Array, amplitude: Array, phase: Array, doppler: Array) -> None:
        """Add the tones of the previous ramp, where the filter passes them."""
        wave, passed = self.waveform, amplitude * self.response(self.waveform.slip_beat(delay) - doppler)
        for tau, height, phi, shift in np.stack((delay, passed, phase, doppler), axis=-1)[passed > 0.0]:
            t = np.arange(int(np.ceil(tau * self.rate))) / self.rate
            cycles = wave.cycles(t) - wave.cycles(t - tau) + shift * t - phi / (2.0 * np.pi)
            signal[: len(t)] += height * np.cos(2.0 * np.pi * np.mod(cycles, 1.0))

    def spectrum(self, signal: ArrayLike) -> Array:
        """Power per range bin of beat signals (..., n_sample): shape (..., n_bin)."""
        window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(self.n_sample) / self.n_sample)
        lines = np.fft.rfft(np.asarray(signal) * (2.0 / np.sum(window) * window), axis=-1)[..., : self.n_bin]
        return np.asarray(lines.real**2 + lines.imag**2)

    def coherent(
        self, ranges: ArrayLike, powers: ArrayLike, phases: ArrayLike = 0.0, range_rates: ArrayLike = 0.0
    ) -> Array:
        """Spectrum of one ramp, rays added with their phases (speckle): shape (n_bin,).  See ``beat_signal``."""
        return self.spectrum(self.beat_signal(ranges, powers, phases, range_rates))

    def incoherent(self, ranges: ArrayLike, powers: ArrayLike, range_rates: ArrayLike = 0.0) -> Array:
        """Spectrum with the powers of the rays added: shape (n_bin,).  See ``beat_signal``.

        Kernel of +-8 bins.  Without the image of each ray at negative frequencies, so not for ranges under 8 bins.
        """
        delay, amplitude, _, doppler = self._echoes(ranges, powers, 0.0, range_rates)
        position = (self.waveform.beat(delay) + doppler) * self.waveform.delta_t
        inside = (position >= 0.0) & (position < self.n_bin)
        position, power = position[inside], amplitude[inside] ** 2
        bins = np.rint(position).astype(np.int64)[:, None] + np.arange(-KERNEL_BINS, KERNEL_BINS + 1)
        shares = power[:, None] * hann_kernel(bins - position[:, None])
        padded = np.bincount((bins + KERNEL_BINS).ravel(), shares.ravel(), self.n_bin + 2 * KERNEL_BINS + 1)
        return np.asarray(padded[KERNEL_BINS : KERNEL_BINS + self.n_bin])

    def _echoes(
        self, ranges: ArrayLike, powers: ArrayLike, phases: ArrayLike, range_rates: ArrayLike
    ) -> tuple[Array, Array, Array, Array]:
        """delay [s], amplitude, phase [rad] and Doppler shift of the beat [Hz] of the rays that came back."""
        columns = np.broadcast_arrays(ranges, powers, phases, range_rates)
        slant_range, power, phase, rate = (np.atleast_1d(np.asarray(c, dtype=np.float64)) for c in columns)
        back = np.isfinite(slant_range) & (power > 0.0)
        if np.any((slant_range[back] < 0.0) | (slant_range[back] >= self.waveform.unambiguous_range)):
            limit = f"the unambiguous {self.waveform.unambiguous_range:.0f} m"
            raise ValueError(f"ranges must not be negative or reach beyond {limit}")
        shift = -doppler_shift(rate[back], self.waveform.f_c)  # a lower echo frequency makes a higher beat
        return delay_of_range(slant_range[back]), np.sqrt(power[back]), phase[back], shift


def _sum_of_tones(amplitude: Array, start: Array, cycles: Array, n: int) -> Array:
    """sum_n amplitude_n cos(2 pi (start_n + cycles_n k)) for k < n: exact, and one product of two small matrices.

    With k = a m + b, cos(u + v) = cos(u) cos(v) - sin(u) sin(v): with m near sqrt(n), 2 n_ray (n / m + m) functions are
    evaluated, not n_ray n.
    """
    m = 1 << round(0.5 * np.log2(n))
    coarse = _phase_angle(start + cycles * m * np.arange(-(-n // m))[:, None])
    fine = _phase_angle(cycles * np.arange(m)[:, None])
    u = np.concatenate((amplitude * np.cos(coarse), -amplitude * np.sin(coarse)), axis=1)
    v = np.concatenate((np.cos(fine), np.sin(fine)), axis=1)
    return np.ascontiguousarray((u @ v.T).ravel()[:n])


def _phase_angle(cycles: Array) -> Array:
    """Angle [rad] of a number of cycles, without the whole ones, for precision."""
    return np.asarray(2.0 * np.pi * (cycles - np.rint(cycles)))
