"""Approaches to a runway in hills: the second receiver through the product's clearance monitor.

The runway's threshold is the origin of the local frame; the aircraft comes down a straight line in space, with errors
of track, height and attitude, and the monitor gets what an honest navigation states.  The product makes the reference
from an elevation model of the ground (``fti reference make``).
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.config import Approach
from fti.hil.approach_reference.approaches import RA4500, TerrainGround
from fti.hil.approach_reference.calibration import make_reference
from fti.hil.approach_reference.options import ReferenceOptions
from fti.messages.outputs import ClearanceIntegrity, IntegrityState
from fti.nav.integrity.approach import Airfield, ApproachPath
from fti.nav.integrity.monitor import ClearanceMonitor, ClearanceSample
from fti.nav.integrity.reference import ApproachReference
from tests.second_receiver.flights import Flight, wander
from tests.second_receiver.geometry import LAT0, LON0, to_geodetic
from tests.second_receiver.ground import POST_M, Surface, make_surface, survey
from tests.second_receiver.heights import terrain_of
from tests.second_receiver.radar import Radar

Array = NDArray[np.float64]

GROUNDS = ("hills", "valley", "woods")
#: Of nominal approaches; of obstacles.
MAX_FALSE, MIN_DETECTED = 0.01, 0.97

COURSE = float(np.deg2rad(70.0))
GLIDE = float(np.deg2rad(3.0))
CROSSING_HEIGHT_M = 15.24
#: Of the threshold before the intercept point [m], level runway.
INTERCEPT_M = CROSSING_HEIGHT_M / float(np.tan(GLIDE))
#: The approach begins here, path length [m].
BEGIN_M = 5000.0
SIZE_M = 7680.0
RELIEF_M, VALLEY_M, CLEAR_M = 25.0, 40.0, 60.0
#: Of the floor and the sides of a valley [m].
VALLEY_RELIEF_M = 10.0
#: Error of the elevation model, and its posts [m].
DEM_VARIES_M, DEM_BIAS_M, DEM_CELL_M = 0.7, 1.0, 5.0

#: Wide enough for the protection levels of every reference here, so that windows are judged [m]: over a steep valley
#: receivers differ by 6.5 m, which no limit of 15 m allows.
ALERT_V_M = 40.0

#: Of the altimeter's output, and of the poses at which the ground is looked at [Hz]; straight lines between.
RATE_HZ, LOOK_HZ = 25.0, 5.0


@dataclass(frozen=True, slots=True)
class Errors:
    """One sigma of what differs between nominal approaches [m, rad]; navigation states its own."""

    track: float = 5.0
    height: float = 5.0
    roll: float = float(np.deg2rad(1.5))
    pitch: float = float(np.deg2rad(1.0))
    crab: float = float(np.deg2rad(4.0))
    nav_horizontal: float = 2.0
    nav_vertical: float = 1.0


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A building or a crane with its load: ``height`` [m] above ground, square, ``width`` [m], at path length s [m]."""

    s: float
    height: float = 150.0
    width: float = 150.0


@dataclass(frozen=True, eq=False)
class Site:
    """An airfield in hills, and its reference."""

    surface: Surface
    reference: ApproachReference


def position_at(s: Array, y: Array) -> tuple[Array, Array]:
    """East and north [m] of path lengths and offsets to the right of the course [m]."""
    forward, right = INTERCEPT_M - s, y
    return (
        forward * np.sin(COURSE) + right * np.cos(COURSE),
        forward * np.cos(COURSE) - right * np.sin(COURSE),
    )


def along(east: Array, north: Array) -> tuple[Array, Array]:
    """Path length and offset [m] of places: the inverse."""
    forward = east * np.sin(COURSE) + north * np.cos(COURSE)
    return INTERCEPT_M - forward, east * np.cos(COURSE) - north * np.sin(COURSE)


def make_ground(kind: str, rng: np.random.Generator) -> Surface:
    """Level at the runway, 60 m below the path where it is high.

    hills : relief of 25 m;  woods : half of it under trees;  valley : winding, its sides at 25 degrees beside the track
    """
    is_valley = kind == "valley"
    terrain = make_surface("hills" if is_valley else kind, rng, SIZE_M, VALLEY_RELIEF_M if is_valley else RELIEF_M)
    east, north = position_at(np.array(0.5 * BEGIN_M), np.array(0.0))
    posts = np.linspace(-0.5 * SIZE_M, 0.5 * SIZE_M - POST_M, len(terrain.top))
    surface = dataclasses.replace(terrain, east0=float(east) - 0.5 * SIZE_M, north0=float(north) - 0.5 * SIZE_M)
    s, y = along(posts[None, :] + float(east), posts[:, None] + float(north))
    away = np.clip((np.hypot(np.maximum(s - INTERCEPT_M, 0.0), y) - 300.0) / 1200.0, 0.0, 1.0)
    highest = np.maximum(s * np.tan(GLIDE) - CLEAR_M, 0.0)
    crowns = (terrain.top - terrain.bare) * (away > 0.3)
    sides = _valley_sides(s, y, rng) if is_valley else 0.0
    bare = np.minimum(away * (terrain.bare - VALLEY_M + sides), highest)
    return dataclasses.replace(surface, top=bare + crowns, bare=bare)


def _valley_sides(s: Array, y: Array, rng: np.random.Generator) -> Array:
    """Height [m] over the floor: from 50 m beside the middle, which winds by 50 m, at 25 degrees up to 120 m."""
    middle = 50.0 * np.sin(2.0 * np.pi * s / rng.uniform(1200.0, 2000.0) + rng.uniform(0.0, 2.0 * np.pi))
    return np.asarray(np.clip((np.abs(y - middle) - 50.0) * np.tan(np.deg2rad(25.0)), 0.0, 120.0))


def with_obstacle(surface: Surface, obstacle: Obstacle) -> Surface:
    """The same ground with something on it that no reference knows."""
    posts = np.linspace(0.0, (len(surface.top) - 1) * POST_M, len(surface.top))
    s, y = along(surface.east0 + posts[None, :], surface.north0 + posts[:, None])
    inside = np.maximum(np.abs(s - obstacle.s), np.abs(y)) < 0.5 * obstacle.width
    added = obstacle.height * inside
    wooded = np.where(inside, 0.0, surface.wooded)
    return dataclasses.replace(surface, top=surface.top + added, bare=surface.bare + added, wooded=wooded)


def airfield() -> Airfield:
    """The airfield file's content."""
    return Airfield(
        name="hills",
        threshold_lat_deg=float(np.rad2deg(LAT0)),
        threshold_lon_deg=float(np.rad2deg(LON0)),
        threshold_alt_m=0.0,
        course_deg=float(np.rad2deg(COURSE)),
        glide_deg=float(np.rad2deg(GLIDE)),
        tch_m=CROSSING_HEIGHT_M,
        runway_length_m=1500.0,
        survey_date="2024-01-01",
    )


def make_site(kind: str, seed: int, runs: int = 400) -> Site:
    """An airfield, and its reference from ``runs`` simulated approaches of the product's own.

    Without the table of obstacles, which the monitor does not read and which takes as long as all the rest.
    """
    rng = np.random.default_rng([seed, 77])
    surface = make_ground(kind, rng)
    model = survey(surface, DEM_CELL_M, rng, DEM_VARIES_M, DEM_BIAS_M)
    plan = ReferenceOptions(
        surface=kind,
        date="2024-01-01",
        s_max=BEGIN_M,
        draws=100,
        runs=runs,
        offset_runs=2,
        obstacle_runs=0,
        seed=seed,
    )
    ground = TerrainGround(ApproachPath(airfield()), RA4500, (terrain_of(model),))
    return Site(surface, make_reference(ground, plan, lambda *_: None))


def fly_approach(surface: Surface, rng: np.random.Generator, errors: Errors | None = None) -> list[ClearanceSample]:
    """Inputs of the monitor on one approach."""
    errors = errors or Errors()
    flight = _descend(rng, errors)
    radar = Radar(width=float(np.deg2rad(40.0 * rng.uniform(0.9, 1.1))), sweeps=2)
    edges = radar.edges(surface, flight.place, flight.axes(), flight.velocity, rng)
    t = np.arange(0.0, flight.t[-1], 1.0 / RATE_HZ)
    agl = radar.output(np.interp(t, flight.t, edges), rng)
    s, y = along(flight.place[:, 0], flight.place[:, 1])
    columns = (s, y, to_geodetic(flight.place)[2], flight.roll, flight.pitch, flight.velocity[:, 2])
    s, y, alt, roll, pitch, climb = (np.interp(t, flight.t, column) for column in columns)
    s, y = (column + wander(t, errors.nav_horizontal, 60.0, rng) for column in (s, y))
    alt = alt + wander(t, errors.nav_vertical, 60.0, rng)
    return [_sample(row, errors) for row in np.stack((t, s, y, alt, agl, roll, pitch, climb), -1)]


def _descend(rng: np.random.Generator, errors: Errors) -> Flight:
    """A nominal approach."""
    speed = rng.normal(60.0, 3.0)
    t = np.arange(0.0, BEGIN_M / speed, 1.0 / LOOK_HZ)
    s, y = BEGIN_M - speed * t, wander(t, errors.track, 60.0, rng)
    up = np.maximum(s * np.tan(GLIDE) + wander(t, errors.height, 60.0, rng) * np.clip(s / 1000.0, 0.0, 1.0), 3.0)
    roll, pitch = wander(t, errors.roll, 5.0, rng), np.deg2rad(1.0) + wander(t, errors.pitch, 10.0, rng)
    level = np.full((len(t), 2), (speed * np.sin(COURSE), speed * np.cos(COURSE)))
    heading = COURSE + wander(t, errors.crab, 60.0, rng)
    place = np.stack((*position_at(s, y), up), -1)
    return Flight(t, place, np.column_stack((level, np.gradient(up, t))), roll, pitch, heading)


def _sample(row: Array, errors: Errors) -> ClearanceSample:
    """Of t, s, y, altitude, height above ground, roll, pitch and climb."""
    t, s, y, alt, agl, roll, pitch, climb = row.tolist()
    t_ns = 10**9 + round(t * 1e9)
    return ClearanceSample(t_ns, t_ns, s, y, alt, agl, roll, pitch, climb, errors.nav_vertical, errors.nav_horizontal)


def monitor_outputs(reference: ApproachReference, samples: list[ClearanceSample]) -> list[ClearanceIntegrity]:
    """Everything that the monitor says on an approach."""
    monitor = ClearanceMonitor(reference, Approach(profile="", alert_v_m=ALERT_V_M))
    return [output for output in (monitor.step(sample) for sample in samples) if output is not None]


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one approach.

    alert_s, over : path length [m] of the first ALERT, None without one; the tests that were near or over their limits
    judged        : share of the outputs with a full window that were results;  refused : reasons of the others
    """

    alert_s: float | None
    over: str
    judged_share: float
    refused: tuple[str, ...]


def outcome_of(outputs: list[ClearanceIntegrity]) -> Outcome:
    """What became of an approach."""
    alerts = [o for o in outputs if o.state is IntegrityState.ALERT]
    full = [o for o in outputs if o.state is not IntegrityState.ACQUIRE]
    judged_share = sum(o.valid for o in full) / max(len(full), 1)
    refused = tuple(sorted({str(reason) for o in full if not o.valid for reason in o.reasons}))
    if not alerts:
        return Outcome(None, "", judged_share, refused)
    ratios = {name: getattr(alerts[0], f"{name}_ratio") for name in ("t1", "t2", "t3", "t4")}
    over = " ".join(name for name, ratio in ratios.items() if (ratio or 0.0) > 0.8)
    return Outcome(alerts[0].s_end, over, judged_share, refused)


def fly_nominal(site: Site, number: int, seed: int) -> Outcome:
    """A nominal approach."""
    rng = np.random.default_rng([seed, 1, number])
    return outcome_of(monitor_outputs(site.reference, fly_approach(site.surface, rng)))


def fly_over_obstacle(site: Site, number: int, seed: int) -> tuple[Obstacle, Outcome]:
    """An approach over something 150 m high and wide that leaves the aircraft at least 20 m."""
    rng = np.random.default_rng([seed, 2, number])
    obstacle = Obstacle(float(rng.choice(_places(site.surface))))
    samples = fly_approach(with_obstacle(site.surface, obstacle), rng)
    return obstacle, outcome_of(monitor_outputs(site.reference, samples))


def _places(surface: Surface) -> Array:
    """Path lengths [m] at which the top of an obstacle of 150 m is 20 m below the path and more."""
    s = np.arange(2500.0, BEGIN_M - 600.0, 10.0)
    top = surface.height(*position_at(s, np.zeros_like(s))) + 150.0
    neighbours = np.max([np.roll(top, k) for k in range(-8, 9)], axis=0)
    return np.asarray(s[neighbours < s * np.tan(GLIDE) - 20.0])


def is_detected(obstacle: Obstacle, outcome: Outcome) -> bool:
    """Whether the first ALERT was by the obstacle: from where a beam of 40 degrees reaches it to 100 m behind it."""
    reach = 0.5 * obstacle.width
    s = outcome.alert_s
    return s is not None and obstacle.s - reach - 100.0 <= s <= obstacle.s + reach + 100.0


def is_earlier(obstacle: Obstacle, outcome: Outcome) -> bool:
    """Whether an ALERT came before the obstacle could be seen."""
    return outcome.alert_s is not None and outcome.alert_s > obstacle.s + 0.5 * obstacle.width + 100.0


def max_failures_by_chance(n: int, share: float) -> int:
    """The 95 % limit of a binomial count of n with a share."""
    below, k = 0.0, -1
    while below < 0.95:
        k += 1
        below += math.comb(n, k) * share**k * (1.0 - share) ** (n - k)
    return k


def line_of_nominal(kind: str, outcomes: list[Outcome]) -> str:
    """The count of false alerts, and what raised them."""
    alarms = [o for o in outcomes if o.alert_s is not None]
    max_alarms = max_failures_by_chance(len(outcomes), MAX_FALSE)
    by = dict(Counter(o.over for o in alarms))
    judged_share = np.mean([o.judged_share for o in outcomes])
    refused = sorted({reason for o in outcomes for reason in o.refused})
    counts = f"ALERT on {len(alarms)} of {len(outcomes)} (at most {max_alarms})"
    return f"{kind:<7} nominal   {counts}  by {by}  judged {judged_share:.0%}, otherwise {refused}"


def line_of_obstacles(kind: str, flights: list[tuple[Obstacle, Outcome]]) -> str:
    """The count of obstacles that raised an ALERT, of those without an earlier one."""
    fresh = [pair for pair in flights if not is_earlier(*pair)]
    detected = sum(is_detected(*pair) for pair in fresh)
    min_detected = len(fresh) - max_failures_by_chance(len(fresh), 1.0 - MIN_DETECTED)
    counts = f"ALERT on {detected} of {len(fresh)} (at least {min_detected})"
    return f"{kind:<7} obstacle  {counts}  beside {len(flights) - len(fresh)} with an earlier one"
