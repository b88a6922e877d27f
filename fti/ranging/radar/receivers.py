"""The two receivers of an FMCW altimeter at radio frequency, mixer by mixer.

A mixer multiplies (appendix B, B.4): tones of the amplitudes a and b leave their sum and difference, each with a b / 2.
Both receivers have three mixers in the signal path, so the beat has an eighth of the amplitude of the echo.

Local oscillator automatic tuning (2.20-2.26), the oscillator follows the transmitter f_if lower:

    rx      signal at the antenna                          sum_n sqrt(P_n) cos(phase(t - tau_n) + phi_n)
    rx_if   rx lo                                          f_rx + f_lo,  f_if - f_b
    rx_lp   its low-pass                                                 f_if - f_b
    trx     rx_lp, and the transmitted signal alike        2 f_if - f_b, f_b
    beat    its low-pass                                                 f_b

Single sideband (2.27-2.31), the oscillator is constant:

    rx      as above
    trx     rx, and the lower sideband of tx lo            f_rx + f_tx - f_lo, f_lo - f_b
    trx_lo  trx lo, no filter between                      f_rx + f_tx, f_rx + f_tx - 2 f_lo, 2 f_lo - f_b, f_b
    beat    its low-pass                                                 f_b

Sampled at four times the highest frequency transmitted or a little more (the source: at least 17.2 GHz, four carriers).
Filters work in the frequency domain and delay nothing.  ``fti.ranging.radar.baseband`` gives the same beat signal
hundreds of times faster; this module is its reference.
Source: Spiegel 2018, sections 2.1.3.4 and 2.2.6, fig. 2.36 and 2.37.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.arrays import Array
from fti.ranging.radar.baseband import Baseband, lowpass
from fti.ranging.radar.waveform import Waveform, delay_of_range

CONVERSION_GAIN = 0.125  #: amplitude of a beat over that of its echo
SETTLE = 64  #: samples of the beat signal discarded at both ends: transients of the filters
BLOCK = 256  #: samples of the beat signal simulated at once
STRETCH = 512  #: samples in which a ray's phase is written as one product


@dataclass(frozen=True, slots=True)
class FmcwReceiver(ABC):
    """A receiver and its samples; ``base`` gives waveform, last filter and rate of the beat signal."""

    base: Baseband = field(default_factory=Baseband)

    @property
    def decimation(self) -> int:
        """Samples at radio frequency per sample of the beat signal; with small factors, for the transforms."""
        wave = self.base.waveform
        return 32 * int(np.ceil(4.0 * (wave.f_c + wave.delta_f) / (32.0 * self.base.rate)))

    @property
    def rate(self) -> float:
        """Samples at radio frequency in a second [Hz]."""
        return self.decimation * self.base.rate

    def times(self, first: int, n: int) -> Array:
        """Times [s] of n samples from the ``first`` after the beginning of a ramp."""
        return np.arange(first, first + n) / self.rate

    def stages(
        self, ranges: ArrayLike, powers: ArrayLike, phases: ArrayLike = 0.0, first: int = 0, n: int = 65536
    ) -> dict[str, Array]:
        """The signal after each stage, in order: n samples from the ``first`` on, at ``rate``.

        ranges (n_ray,) [m], NaN where a ray met nothing; powers (n_ray,) received over transmitted; phases [rad].
        Needs about 100 bytes for each sample.
        """
        settle = SETTLE * self.decimation
        t = self.times(first - settle, n + 2 * settle)
        rx = received_signal(self.base.waveform, t, ranges, powers, phases)
        return {name: signal[settle : settle + n] for name, signal in self._mixed(t, rx).items()}

    @abstractmethod
    def _mixed(self, t: Array, rx: Array) -> dict[str, Array]:
        """``rx`` and the signals of the receiver stages."""

    def beat_signal(self, ranges: ArrayLike, powers: ArrayLike, phases: ArrayLike = 0.0) -> Array:
        """The beat signal of a ramp, amplitudes as received: as ``Baseband.beat_signal``, shape (n_sample,).

        Block by block: some 50 MB for 2051 rays at 4.3 GHz.
        """
        signal = np.empty(self.base.n_sample)
        for start in range(0, self.base.n_sample, BLOCK):
            n = min(BLOCK, self.base.n_sample - start)
            block = self.stages(ranges, powers, phases, start * self.decimation, n * self.decimation)["beat"]
            signal[start : start + n] = block[:: self.decimation] / CONVERSION_GAIN
        return signal

    def coherent(self, ranges: ArrayLike, powers: ArrayLike, phases: ArrayLike = 0.0) -> Array:
        """Spectrum of one ramp: as ``Baseband.coherent``, shape (n_bin,)."""
        return self.base.spectrum(self.beat_signal(ranges, powers, phases))

    def _last_filter(self, signal: Array) -> Array:
        """The low-pass that leaves the beat."""
        return apply_response(signal, self.base.response(np.fft.rfftfreq(len(signal), 1.0 / self.rate)))

    def _lowpass(self, signal: Array, last_passed: float, first_stopped: float) -> Array:
        """A low-pass between two mixers."""
        return apply_response(
            signal, lowpass(np.fft.rfftfreq(len(signal), 1.0 / self.rate), last_passed, first_stopped)
        )


@dataclass(frozen=True, slots=True)
class Loat(FmcwReceiver):
    """Local oscillator automatic tuning; f_if : intermediate frequency [Hz].

    Raises ValueError for an intermediate frequency whose products the filters cannot separate.
    """

    f_if: float = 200e6

    def __post_init__(self) -> None:
        wave = self.base.waveform
        if not 0.5 * self.base.rate < self.f_if < 0.25 * wave.f_c - wave.delta_f:
            raise ValueError(f"f_if is {self.f_if} Hz, must lie above the beats and delta_f below a quarter of f_c")

    def _mixed(self, t: Array, rx: Array) -> dict[str, Array]:
        wave = self.base.waveform
        lo = np.cos(wave.phase(t) - 2.0 * np.pi * self.f_if * t)
        between = 0.25 * wave.f_c, 0.5 * wave.f_c
        tx_lp = self._lowpass(wave.transmitted(t) * lo, *between)
        rx_if = rx * lo
        rx_lp = self._lowpass(rx_if, *between)
        trx = rx_lp * tx_lp
        return {"rx": rx, "rx_if": rx_if, "rx_lp": rx_lp, "trx": trx, "beat": self._last_filter(trx)}


@dataclass(frozen=True, slots=True)
class Ssb(FmcwReceiver):
    """Single sideband; f_lo : constant local oscillator [Hz].

    Raises ValueError for an oscillator whose sidebands overlap, or that is not above the beats.
    """

    f_lo: float = 500e6

    def __post_init__(self) -> None:
        wave = self.base.waveform
        if not max(0.5 * wave.delta_f, 0.5 * self.base.rate) < self.f_lo < 0.5 * wave.f_c:
            raise ValueError(f"f_lo is {self.f_lo} Hz, must lie above delta_f / 2 and the beats and below f_c / 2")

    def _mixed(self, t: Array, rx: Array) -> dict[str, Array]:
        wave = self.base.waveform
        lo = np.cos(2.0 * np.pi * self.f_lo * t)
        sideband = self._lowpass(wave.transmitted(t) * lo, wave.f_c + wave.delta_f - self.f_lo, wave.f_c + self.f_lo)
        trx = rx * sideband
        trx_lo = trx * lo
        return {"rx": rx, "trx": trx, "trx_lo": trx_lo, "beat": self._last_filter(trx_lo)}


def apply_response(signal: Array, response: Array) -> Array:
    """A signal after a filter with the given response at ``rfftfreq``; periodic."""
    return np.asarray(np.fft.irfft(np.fft.rfft(signal) * response, len(signal)))


def line_spectrum(signal: Array, rate: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes of the tones in a signal, Hann window: a tone of the amplitude a reads a."""
    window = np.hanning(len(signal) + 1)[:-1]
    lines = np.abs(np.fft.rfft(signal * window)) * (2.0 / np.sum(window))
    return np.asarray(np.fft.rfftfreq(len(signal), 1.0 / rate)), np.asarray(lines)


def received_signal(
    waveform: Waveform, t: Array, ranges: ArrayLike, powers: ArrayLike, phases: ArrayLike = 0.0
) -> Array:
    """The signal at the antenna at equally spaced times t [s]: sum_n sqrt(P_n) cos(phase(t - tau_n) + phi_n).

    Over a stretch from t_a on, s = t - t_a, the phase of an echo that stays in one ramp, begun at t_r, is in cycles

        cycles(t_a - tau) + (f_c + f' (t_a - t_r)) s + f' s^2 / 2 - f' tau s

    one factor of stretch and ray, one of stretch and time, one of ray and time: the sum is a matrix product.  The few
    echoes that change from ramp to ramp within a stretch are added individually.
    """
    columns = np.broadcast_arrays(ranges, powers, phases)
    slant_range, power, phase = (np.atleast_1d(np.asarray(c, dtype=np.float64)) for c in columns)
    back = np.isfinite(slant_range) & (power > 0.0)
    delay, amplitude, turn = delay_of_range(slant_range[back]), np.sqrt(power[back]), phase[back] / (2.0 * np.pi)
    step = float(t[1] - t[0])
    s = step * np.arange(STRETCH)
    starts = t[0] + step * STRETCH * np.arange(-(-len(t) // STRETCH))
    first, last = (np.floor((starts[:, None] + end - delay) / waveform.delta_t) for end in (0.0, s[-1]))
    signal, by_time = np.zeros((len(starts), STRETCH)), _phasors(-waveform.beat(delay)[:, None] * s)
    for ramp in np.unique(first):
        whole = (first == ramp) & (last == ramp)
        rows = np.any(whole, axis=1)
        begun = starts[rows, None]
        by_ray = np.where(whole[rows], amplitude, 0.0) * _phasors(waveform.cycles(begun - delay) + turn)
        f_begun = waveform.f_c + waveform.slope * (begun - ramp * waveform.delta_t)
        signal[rows] += (_phasors((f_begun + 0.5 * waveform.slope * s) * s) * (by_ray @ by_time)).real
    for row, ray in np.argwhere(first != last):
        cycles = waveform.cycles(starts[row] + s - delay[ray]) + turn[ray]
        signal[row] += amplitude[ray] * np.cos(2.0 * np.pi * (cycles - np.rint(cycles)))
    return np.ascontiguousarray(signal.ravel()[: len(t)])


def _phasors(cycles: Array) -> NDArray[np.complex128]:
    """exp(2 pi j cycles)."""
    return np.asarray(np.exp(2j * np.pi * (cycles - np.rint(cycles))))
