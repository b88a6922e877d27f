"""A synthetic approach: a bumpy profile known in closed form, limits chosen by hand."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from fti.nav.integrity.approach import Airfield, ApproachPath
from fti.nav.integrity.monitor import ClearanceSample
from fti.nav.integrity.reference import (
    ApproachReference,
    Limits,
    ReferenceHeader,
    ReferenceProfile,
    ReferenceSensor,
    grid,
)

S_MAX = 3000.0
RATE_HZ = 25.0
SPEED = 60.0


def bumps(s: np.ndarray) -> np.ndarray:
    """Altitude of the terrain [m]: bumps of several lengths, flat on the runway."""
    waves = 6 * np.sin(s / 37) + 5 * np.sin(s / 83 + 1) + 8 * np.sin(s / 171 + 2)
    return np.asarray(200.0 + waves * np.clip(s / 300, 0, 1))


@pytest.fixture
def airfield() -> Airfield:
    return Airfield(
        name="test",
        threshold_lat_deg=48.0,
        threshold_lon_deg=11.0,
        threshold_alt_m=200.0,
        course_deg=250.0,
        runway_length_m=1500.0,
        survey_date="2024-01-01",
    )


@pytest.fixture
def reference(airfield: Airfield) -> ApproachReference:
    s = grid(5.0, S_MAX)
    profile = ReferenceProfile(
        surface="bumps",
        made_from="terrain",
        date="2024-01-01",
        ds_m=5.0,
        s_max_m=S_MAX,
        draws=100,
        seed=1,
        window_m=400.0,
        correlation_m=40.0,
        datum_sd_m=1.0,
    )
    interval = (1.0, 100.0)
    limits = Limits(
        t1=20.0,
        t2=9.0,
        t3=4.0,
        t4=6.0,
        t1_interval=interval,
        t2_interval=interval,
        t3_interval=interval,
        t4_interval=interval,
        pfa=0.01,
        pmd=1e-3,
        verified_runs=0,
        verified_alarms=0,
        runs=200,
        seed=1,
        method="by hand",
    )
    header = ReferenceHeader(
        airfield=airfield, sensor=ReferenceSensor(kind="radar", beam_deg=40.0), profile=profile, limits=limits
    )
    z = np.round(bumps(s), 3)
    return ApproachReference(header, s, z, np.full_like(s, 1.0), np.full_like(s, 0.5))


@pytest.fixture
def ground() -> Callable[[np.ndarray], np.ndarray]:
    """Altitude of the terrain [m]."""
    return bumps


@pytest.fixture
def path(airfield: Airfield) -> ApproachPath:
    return ApproachPath(airfield)


Flight = Callable[..., Iterator[ClearanceSample]]


@pytest.fixture
def flight(path: ApproachPath) -> Flight:
    """A flight down the path over the bumps, with what is to go wrong as functions of s."""

    def fly(
        *,
        begin: float = S_MAX,
        end: float = 0.0,
        surface: Callable[[float], float] = lambda s: 0.0,
        agl: Callable[[float, float], float] = lambda s, h: h,
        nav_s: Callable[[float], float] = lambda s: s,
        nav_alt: float = 0.0,
        height: float = 0.0,
        y: Callable[[float], float] = lambda s: 0.0,
        roll: Callable[[float], float] = lambda s: 0.0,
        climb: float = -3.0,
        speed: float = SPEED,
        start_ns: int = 10**9,
        seed: int = 1,
    ) -> Iterator[ClearanceSample]:
        rng = np.random.default_rng(seed)
        for k in range(int((begin - end) / speed * RATE_HZ)):
            s = begin - speed * k / RATE_HZ
            alt = float(path.alt_path(s)) + height
            clear = alt - float(bumps(np.array(s))) - surface(s) + rng.normal(0.0, 0.3)
            t_ns = start_ns + round(k / RATE_HZ * 1e9)
            yield ClearanceSample(t_ns, t_ns, nav_s(s), y(s), alt + nav_alt, agl(s, clear), roll(s), 0.02, climb, 1.0)

    return fly
