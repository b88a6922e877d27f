"""A radar altimeter: an antenna, the radar equation over patches of ground, and a receiver's leading edge.

power of a patch    G(off)^2 sigma0(incidence) / d^4 dA            two-way pattern, monostatic radar equation
G(off)              exp(-4 ln2 (off / width)^2)                    Gaussian, full width at half power
sigma0              open land: a peak of 22 deg about the normal above a diffuse share; woods: cosine
waveform            power by range, smoothed by the range resolution, averaged over sweeps, with speckle
range               where the waveform first passes 10 dB below its peak, less what level ground gives too little
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.second_receiver.ground import Surface, make_surface

Array = NDArray[np.float64]

FOOT_M = 0.3048
#: RA-4500: steps [ft] up to heights [ft].
STEPS_FT = np.array([1.0, 2.0, 5.0, 20.0, 50.0, 100.0])
STEPS_UP_TO_FT = np.array([119.0, 199.0, 499.0, 999.0, 2099.0])
#: Of an altimeter without them.
FINE_STEP_M = 0.01

RINGS, SPOKES = 48, 84
AVERAGED_S = 0.2
#: Independent looks that an average over 0.2 s has: leaves 18 % of speckle in a bin.
LOOKS = 30
BIN_M = 0.5
RESOLUTION_SD_M = 0.6
THRESHOLD = 10.0 ** (-10.0 / 10.0)
#: Beyond this angle off the vertical no ground counts [rad].
WIDEST = np.deg2rad(62.0)


@dataclass(frozen=True, slots=True)
class Radar:
    """An altimeter.

    width  : of the antenna, full at half power [rad];  noise : thermal, one sigma [m];  steps : those of the RA-4500
    sweeps : that are averaged over 0.2 s
    """

    width: float = float(np.deg2rad(40.0))
    noise: float = 0.3
    steps: bool = True
    sweeps: int = 4

    def sd(self, height: Array) -> Array:
        """One sigma that such an instrument states [m]: noise, and its step over the root of 12."""
        return np.asarray(np.hypot(self.noise, self._step(height) / np.sqrt(12.0)))

    def measure(self, surface: Surface, place: Array, axes: Array, velocity: Array, rng: np.random.Generator) -> Array:
        """Ranges [m] (n,), NaN without a return.

        place : of the antenna, east, north, up (n, 3) [m];  axes : body to east, north, up (n, 3, 3);  velocity (n, 3)
        """
        return self.output(self.edges(surface, place, axes, velocity, rng), rng)

    def edges(self, surface: Surface, place: Array, axes: Array, velocity: Array, rng: np.random.Generator) -> Array:
        """Ranges [m] (n,) before noise and steps."""
        return _zero() + np.array([self._edge(surface, *pose, rng) for pose in zip(place, axes, velocity, strict=True)])

    def output(self, edges: Array, rng: np.random.Generator) -> Array:
        """With noise, in steps."""
        ranges = edges + rng.normal(0.0, self.noise, len(edges))
        step = self._step(ranges)
        return np.asarray(np.maximum(np.rint(ranges / step) * step, 0.0))

    def _step(self, height: Array) -> Array:
        return step_m(height) if self.steps else np.full(np.shape(height), FINE_STEP_M)

    def _edge(self, surface: Surface, place: Array, axes: Array, velocity: Array, rng: np.random.Generator) -> float:
        """Range [m] of the leading edge, without calibration and noise."""
        times = (np.arange(self.sweeps) - 0.5 * (self.sweeps - 1)) / self.sweeps * AVERAGED_S
        ranges, powers = self._patches(surface, place + times[:, None] * velocity, axes[:, 2], rng)
        waveform, first = _waveform(ranges, powers, rng)
        over = np.flatnonzero(waveform > THRESHOLD * waveform.max())
        k = int(over[0])
        share = (THRESHOLD * waveform.max() - waveform[k - 1]) / (waveform[k] - waveform[k - 1])
        return first + (k - 1 + float(share)) * BIN_M

    def _patches(
        self, surface: Surface, places: Array, boresight: Array, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """Ranges [m] and powers of patches of ground, of all sweeps: jittered rings about the point below."""
        below = places[:, 2] - surface.height(places[:, 0], places[:, 1])
        shape = (len(places), RINGS, SPOKES)
        off = (np.arange(RINGS)[:, None] + rng.random(shape)) * (WIDEST / RINGS)
        turn = (np.arange(SPOKES) + rng.random(shape)) * (2.0 * np.pi / SPOKES)
        high = np.maximum(below, 1.0)[:, None, None]
        radius = high * np.tan(off)
        area = radius * high / np.cos(off) ** 2  # per unit of off and turn
        east = places[:, 0, None, None] + radius * np.cos(turn)
        north = places[:, 1, None, None] + radius * np.sin(turn)
        up, wooded = surface.height(east, north), surface.is_wooded(east, north)
        into = rng.random(shape)
        crown = up - rng.exponential(1.2, shape)
        if wooded.any():
            up = np.where(wooded, np.where(into < 0.2, surface.bare_height(east, north), crown), up)
        to = np.stack(
            (east - places[:, 0, None, None], north - places[:, 1, None, None], up - places[:, 2, None, None])
        )
        distance = np.sqrt(np.sum(to**2, axis=0))
        cosine = np.tensordot(boresight, to, 1) / distance
        rise_e, rise_n = surface.slopes(east, north)
        rise_e, rise_n = (np.where(wooded, 0.0, np.clip(rise, -1.5, 1.5)) for rise in (rise_e, rise_n))
        slant = np.sqrt(1.0 + rise_e**2 + rise_n**2)
        cos_incidence = np.clip((rise_e * to[0] + rise_n * to[1] - to[2]) / (slant * distance), 0.0, 1.0)
        gain = np.exp(-4.0 * np.log(2.0) * (np.arccos(np.clip(cosine, -1.0, 1.0)) / self.width) ** 2)
        power = gain**2 * _sigma0(cos_incidence, wooded) / distance**4 * area * slant
        return distance.ravel(), power.ravel()


def _sigma0(cos_incidence: Array, wooded: NDArray[np.bool_]) -> Array:
    """Backscatter per area [-]."""
    tan_sq = 1.0 / np.maximum(cos_incidence, 1e-3) ** 2 - 1.0
    return np.where(wooded, 0.5 * cos_incidence, 0.25 * cos_incidence + 0.75 * np.exp(-tan_sq / 0.4**2))


def _waveform(ranges: Array, powers: Array, rng: np.random.Generator) -> tuple[Array, float]:
    """Mean power by range in bins, and the range of the first one [m]."""
    tail = np.ceil(4.0 * RESOLUTION_SD_M / BIN_M)
    first = (np.floor(ranges.min() / BIN_M) - 2.0 * tail) * BIN_M
    at = (ranges - first) / BIN_M
    k = at.astype(np.intp)
    count = int(k.max()) + 2
    bins = np.bincount(k, powers * (1.0 - (at - k)), count) + np.bincount(k + 1, powers * (at - k), count)
    kernel = np.exp(-0.5 * (np.arange(-tail, tail + 1) * BIN_M / RESOLUTION_SD_M) ** 2)
    speckle = rng.gamma(LOOKS, 1.0 / LOOKS, count)
    return np.convolve(bins * speckle, kernel / kernel.sum(), "same"), float(first)


def step_m(height: Array) -> Array:
    """Steps [m] of the RA-4500 at heights [m]."""
    return np.asarray(STEPS_FT[np.searchsorted(STEPS_UP_TO_FT, np.asarray(height) / FOOT_M)] * FOOT_M)


@functools.cache
def _zero() -> float:
    """What the nominal antenna's edge is short of the height [m], 100 m over level ground: how one adjusts the type."""
    rng = np.random.default_rng(5)
    level = make_surface("level", rng, size_m=640.0)
    place, axes = np.array([0.0, 0.0, 100.0]), np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    radar = Radar()
    edges = [radar._edge(level, place, axes, np.array([60.0, 0.0, 0.0]), rng) for _ in range(64)]
    return float(100.0 - level.height(0.0, 0.0) - np.mean(edges))
