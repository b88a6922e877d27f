"""Pseudoranges of a simulated constellation, made in the inertial frame and without any formula of the product.

24 satellites on circles of 12 h, six planes of 55 deg.  The range is the straight way of light from the place of the
satellite at transmission to that of the receiver at reception, both in the inertial frame that lies on the earth frame
at the begin of the week.

    clocks       0.1 ms of satellites, that of the receiver as given
    ephemerides  2 m;  noise 0.5 m;  multipath 0.5 m at the zenith and 3 m at 10 deg
    ionosphere   a vertical delay and its slope over the ground, mapped by a thin shell in 350 km
    troposphere  2.3 m at the zenith at sea level
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer

from fti.messages.measurements import Ephemeris, Pseudorange, Pseudoranges, Stamp, TimeScale

Array = NDArray[np.float64]

C, MU, EARTH_RATE = 299_792_458.0, 3.986005e14, 7.2921151467e-5
RADIUS, INCLINATION = 26_560_000.0, math.radians(55.0)
MEAN_MOTION = math.sqrt(MU / RADIUS**3)
TO_ECEF = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
WEEK, TOE = 2200, 302_400.0
WEEK_NS = 604_800 * 1_000_000_000


@dataclass(frozen=True)
class Sky:
    """Of one place and time.  iono : vertical delay [m], its slope to north and east [m per 1000 km]"""

    lat: float
    lon: float
    alt: float
    t: float
    iono: tuple[float, float, float] = (5.0, 1.0, 1.0)
    clock: float = 1e-4


def node(number: int) -> float:
    return 2.0 * math.pi * ((number - 1) % 6) / 6.0


def phase(number: int) -> float:
    return 2.0 * math.pi * ((number - 1) // 6) / 4.0 + 0.26 * ((number - 1) % 6)


def clock_of(number: int) -> float:
    """Offset of a satellite's clock [s]."""
    return 1e-4 * math.sin(3.0 * number)


def ephemerides(rx_ns: int = 0) -> list[Ephemeris]:
    """Broadcast ephemerides of the constellation: those of circles, without harmonics."""
    return [
        Ephemeris(
            stamp=Stamp(rx_ns), system="gps", number=number, week=WEEK % 1024, issue=1, toc=TOE, af0=clock_of(number),
            af1=0.0, af2=0.0, tgd=0.0, toe=TOE, sqrt_a=math.sqrt(RADIUS), e=0.0, m0=phase(number), delta_n=0.0,
            omega0=node(number), omega_dot=0.0, i0=INCLINATION, idot=0.0, omega=0.0, cuc=0.0, cus=0.0, cic=0.0,
            cis=0.0, crc=0.0, crs=0.0, accuracy=2.4, healthy=True,
        )
        for number in range(1, 25)
    ]  # fmt: skip


def satellite_i(number: int, t: float) -> Array:
    """Inertial place of a satellite [m]."""
    u, big = phase(number) + MEAN_MOTION * (t - TOE), node(number)
    along = np.array([math.cos(big), math.sin(big), 0.0])
    across = math.cos(INCLINATION) * np.array([-math.sin(big), math.cos(big), 0.0])
    across[2] = math.sin(INCLINATION)
    return RADIUS * (math.cos(u) * along + math.sin(u) * across)


def frame_of(lat: float, lon: float, t: float) -> Array:
    """Rows: north, east, up at a place, in the inertial frame at t."""
    turned = lon + EARTH_RATE * t
    north = [-math.sin(lat) * math.cos(turned), -math.sin(lat) * math.sin(turned), math.cos(lat)]
    east = [-math.sin(turned), math.cos(turned), 0.0]
    up = [math.cos(lat) * math.cos(turned), math.cos(lat) * math.sin(turned), math.sin(lat)]
    return np.array([north, east, up])


def receiver_i(sky: Sky) -> Array:
    x, y, z = TO_ECEF.transform(math.degrees(sky.lon), math.degrees(sky.lat), sky.alt)
    turn = EARTH_RATE * sky.t
    return np.array([x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn), z])


def light_time(number: int, place_i: Array, t: float) -> float:
    """From a satellite to a place at t [s]."""
    tau = 0.07
    for _ in range(8):
        tau = float(np.linalg.norm(satellite_i(number, t - tau) - place_i)) / C
    return tau


def atmosphere(sky: Sky, sin_e: float, to_north: float, to_east: float) -> float:
    """Delay [m]; the ionosphere is pierced where the line of sight meets the shell."""
    elevation = math.asin(sin_e)
    psi = math.pi / 2 - elevation - math.asin(6371.0 / 6721.0 * math.cos(elevation))
    level = math.hypot(to_north, to_east) or 1.0
    north, east = (6.371 * psi * part / level for part in (to_north, to_east))  # 1000 km
    vertical = max(sky.iono[0] + sky.iono[1] * north + sky.iono[2] * east, 0.5)
    at_shell = vertical / math.cos(math.pi / 2 - elevation - psi)  # zenith angle less the angle at the earth's centre
    return at_shell + 2.3 * math.exp(-max(sky.alt, 0.0) / 7500.0) * 1.001 / math.sqrt(0.002001 + sin_e**2)


def observe(sky: Sky, rng: np.random.Generator, slow: Array | None = None, rx_ns: int = 0) -> Pseudoranges:
    """Pseudoranges of what is above 5 deg.  slow : errors that last, one a satellite [1 sigma of multipath]"""
    place, rows, found = receiver_i(sky), frame_of(sky.lat, sky.lon, sky.t), []
    slow = rng.standard_normal(25) if slow is None else slow
    for number in range(1, 25):
        tau = light_time(number, place, sky.t)
        line = satellite_i(number, sky.t - tau) - place
        north, east, up = rows @ (line / np.linalg.norm(line))
        if up < math.sin(math.radians(5.0)):
            continue
        multipath = 0.5 + 2.5 * math.sin(math.radians(10.0)) / up
        errors = rng.normal(0.0, 0.5) + 2.0 * math.sin(7.0 * number) + multipath * slow[number]
        true = C * (tau + sky.clock - clock_of(number)) + atmosphere(sky, up, north, east)
        found.append(Pseudorange(
            system="gps", number=number, signal="L1C", pseudorange=true + errors, pseudorange_sd=0.5, cn0_dbhz=45.0,
        ))  # fmt: skip
    t_dev_ns = WEEK * WEEK_NS + round((sky.t + sky.clock) * 1e9)
    return Pseudoranges(stamp=Stamp(rx_ns, t_dev_ns, TimeScale.GPS), observations=tuple(found))
