"""Received power of each ray of a beam, and its distribution over range bins.

The radar equation (2.18) for a patch dA of ground with the cross section sigma0 per area, seen under the angle of
incidence theta_i; a ray stands for the solid angle d_omega, so its patch is dA = d^2 d_omega / cos(theta_i):

    P_rx / P_tx = sum_n  G_n^2 lambda^2 sigma0(theta_i,n) / ((4 pi)^3 d_n^4)  dA_n
                = sum_n  [G_n^2 lambda^2 d_omega_n / (4 pi)^3]  sigma0(theta_i,n) / (d_n^2 cos(theta_i,n))

The bracket depends on antenna and dome only and is computed once.  Eq. 2.68 as printed gives every ray the same sigma:
its sum grows with the number of rays, and falls with d^-4, although that of beam-filling ground falls with d^-2.

    sigma0(theta) = sigma0(0) cos^q(theta)          q = 1: constant gamma;  q = 2: Lambert

Source: Spiegel 2018, sections 2.1.3.2 and 2.2.5, erratum 2.68; Moore 1990, "Ground echo", in Skolnik, Radar handbook,
2nd ed., ch. 12 (sigma0, gamma, Lambert); the window's kernel: ``fti.ranging.radar.baseband``.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Codes
from fti.geodesy.formulas import rotate
from fti.geodesy.rotations import rows_of
from fti.kernel import kernel
from fti.ranging.radar.antenna import Antenna, from_db
from fti.ranging.radar.baseband import KERNEL_BINS, hann_kernel
from fti.ranging.radar.dome import Dome
from fti.ranging.sensor import Poses
from fti.terrain.pyramid import Pyramid, heights_at, layers_at
from fti.terrain.ray_cast import first_event
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.surface import Posts, surface
from fti.terrain.terrain import Terrain

_HIT = int(RayOutcome.HIT)
_STEPS = 1024
KERNEL = hann_kernel(
    np.arange(-KERNEL_BINS, KERNEL_BINS + 1) - (np.arange(_STEPS + 1)[:, None] / _STEPS - 0.5)
)  #: of a ray at each 1/1024 of its bin: (1025, 17)


@dataclass(frozen=True, slots=True)
class Backscatter:
    """Radar cross section of the ground per area, sigma0 cos^q(angle of incidence).

    nadir_db : sigma0 at vertical incidence [dB]; exponent : q, 1 (constant gamma) or more, 2 for Lambert's law.
    Raises ValueError for an exponent below 1 (a grazed patch would be the brightest) or a level that is not finite.
    """

    nadir_db: float = 0.0
    exponent: float = 2.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.exponent) and self.exponent >= 1.0):
            raise ValueError(f"exponent is {self.exponent}, must be at least 1")
        if not np.isfinite(self.nadir_db):
            raise ValueError(f"nadir_db is {self.nadir_db} dB, must be finite")


@dataclass(frozen=True, eq=False)
class Beam:
    """The cast rays.

    rays_s  : ndarray, shape (n, 3)         unit vectors of the sensor frame, nearest to the boresight first
    weights : ndarray, shape (n,)    [m^2]  G^2 lambda^2 d_omega / (4 pi)^3 of each
    """

    rays_s: Array
    weights: Array

    def __len__(self) -> int:
        return len(self.rays_s)


def make_beam(antenna: Antenna, dome: Dome, wavelength: float, cut_db: float = -40.0) -> Beam:
    """The rays of a dome weighted by an antenna, wavelength [m].

    cut_db : rays whose two-way gain is this far below that of the strongest are removed [dB].  At -40 dB they have
             3e-6 of the power over level ground, and the wide antenna extends to 75 deg off the boresight.
    Raises ValueError for a wavelength that is not positive, or where no ray has any gain.
    """
    if not wavelength > 0.0:
        raise ValueError(f"wavelength is {wavelength} m, must be positive")
    two_way = antenna.gain(dome.rays_s) ** 2
    if not two_way.any():
        raise ValueError(f"the antenna has no gain along any of the {len(dome)} rays: its cuts must be wider")
    cast = two_way >= from_db(cut_db) * two_way.max()
    weights = two_way * dome.solid_angles * wavelength**2 / (4.0 * np.pi) ** 3
    return Beam(np.ascontiguousarray(dome.rays_s[cast]), np.ascontiguousarray(weights[cast]))


class BeamEchoes(NamedTuple):
    """Echoes of the rays of a beam at n poses, each of shape (n, rays).

    ranges      : [m] NaN where a ray met nothing
    range_rates : [m/s] growing, by the motion of the sensor
    powers      : received over transmitted; 0 where a ray met nothing
    outcomes    : numbers of ``RayOutcome``
    """

    ranges: Array
    range_rates: Array
    powers: Array
    outcomes: Codes


def trace_beam(terrain: Terrain, poses: Poses, beam: Beam, ground: Backscatter, max_range: float) -> BeamEchoes:
    """Cast the rays of a beam at each pose, as far as ``max_range`` [m]."""
    gains = beam.weights * float(from_db(ground.nadir_db))
    arrays = _trace(
        terrain.pyramid, poses.origins_l, poses.mats_ls, poses.vels_l, beam.rays_s, gains, ground.exponent - 1.0,
        float(max_range),
    )  # fmt: skip
    return BeamEchoes(*arrays)


@kernel
def _trace(
    p: Pyramid, origins: Array, mats: Array, vels: Array, rays: Array, gains: Array, power: float, max_range: float
) -> tuple[Array, Array, Array, Codes]:
    """Rays of all poses: range, rate of the range, received power, outcome; ``power`` of the cosine of incidence."""
    shape = (len(origins), len(rays))
    ranges, rates, powers = np.empty(shape), np.empty(shape), np.empty(shape)
    outcomes = np.empty(shape, np.uint8)
    for i in range(len(origins)):
        into = ranges[i], rates[i], powers[i], outcomes[i]
        trace_pose(p, origins[i], mats[i], vels[i], rays, gains, power, max_range, *into)
    return ranges, rates, powers, outcomes


@kernel
def trace_pose(
    p: Pyramid,
    o: Array,
    mat: Array,
    vel: Array,
    rays: Array,
    gains: Array,
    power: float,
    max_range: float,
    ranges: Array,
    rates: Array,
    powers: Array,
    outcomes: Codes,
) -> None:
    """The rays of one pose, written to four arrays (rays,)."""
    q = p.addresses  # a call with the argument p counts references and takes longer
    posts, rows = Posts(heights_at(q), layers_at(q)), rows_of(mat)
    for k in range(len(rays)):
        dx, dy, dz = rotate(rows, (rays[k, 0], rays[k, 1], rays[k, 2]))
        d, outcome = first_event(q, o[0], o[1], o[2], dx, dy, dz, max_range)
        if outcome != _HIT:
            d = math.nan
        ranges[k], powers[k], outcomes[k] = d, 0.0, outcome
        rates[k] = -(vel[0] * dx + vel[1] * dy + vel[2] * dz)
        if d > 0.0:
            _, to_east, to_north = surface(posts, o[0] + d * dx, o[1] + d * dy)
            cosine = (dx * to_east + dy * to_north - dz) / math.sqrt(1.0 + to_east**2 + to_north**2)
            if cosine > 0.0:  # NaN on the rim of a hole
                powers[k] = gains[k] * cosine**power / (d * d)


def range_bins(ranges: Array, powers: Array, bin_m: float, n_bin: int) -> Array:
    """Power per range bin, shape (n, n_bin), of the rays of n poses: the powers of the rays, spread by the window.

    The kernel of a Hann window, +-8 bins: the average spectrum of the beat signal over the phases of the rays.  The
    position of a ray in its bin is rounded to 1/1024: 0.02 dB within 20 dB of the strongest.

    ranges, powers : (n, rays)  [m], received over transmitted; a range that is NaN, negative or beyond is ignored
    bin_m          : range of one bin [m]; bin k is centred at the range k bin_m
    """
    return _fill(ranges, powers, bin_m, n_bin, KERNEL)[:, KERNEL_BINS : KERNEL_BINS + n_bin]


@kernel
def _fill(ranges: Array, powers: Array, bin_m: float, n_bin: int, table: Array) -> Array:
    """Range bins with a margin of half the table's width on either side; row i of the table: a ray at i / steps - 1/2
    of a bin.
    """
    spectra = np.zeros((len(ranges), n_bin + table.shape[1]))
    for i in range(len(ranges)):
        fill_pose(ranges[i], powers[i], bin_m, n_bin, table, spectra[i])
    return spectra


@kernel
def fill_pose(ranges: Array, powers: Array, bin_m: float, n_bin: int, table: Array, spectrum: Array) -> None:
    """Add the rays of one pose to its bins, with their margin."""
    steps, width = table.shape[0] - 1, table.shape[1]
    for k in range(len(ranges)):
        place = ranges[k] / bin_m
        if place >= 0.0 and place < n_bin:
            middle = int(place + 0.5)
            at = int((place - middle + 0.5) * steps + 0.5)
            for j in range(width):
                spectrum[middle + j] += powers[k] * table[at, j]
