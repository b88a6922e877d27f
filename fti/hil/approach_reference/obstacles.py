"""Smallest obstacle that T4 detects, by its width and the part of the track: the obstacle table of a reference.

A box as long as it is wide is on the track, at a few random places in each kilometre, on the terrain of the reference.
Nominal approaches fly over it, with every range traced; it is detected if T4 exceeds its limit in two consecutive
updates, the condition of an ALERT.  The table has the smallest of the tested heights whose number of misses proves a
Pd of 0.97:

    P(misses <= m) <= 5 %       m misses, binomial with 1 - Pd of n flights      n = 100: none, n = 200: one

(the exact lower limit of Clopper and Pearson 1934).  inf: no tested height, or none that the aircraft clears by 10 m,
or no space for a whole window before the obstacle.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fti.arrays import Array
from fti.config import Approach
from fti.hil.approach_reference.approaches import SimulatedApproach, TerrainGround, run_monitor, simulate, track_of
from fti.hil.approach_reference.options import Progress, ReferenceOptions, TaskRunner, run_serially
from fti.hil.environment import add_obstacles
from fti.hil.tables.fault_types import Obstacle
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.batch_monitor import BatchMonitor
from fti.nav.integrity.monitor import ClearanceMonitor
from fti.nav.integrity.reference import ApproachReference, Obstacles
from fti.terrain.layer import Layer
from fti.terrain.terrain import Terrain

PD, CONFIDENCE = 0.97, 0.95
WIDTHS_M = (30.0, 60.0, 100.0)
HEIGHTS_M = (10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 75.0, 100.0, 125.0, 150.0)
PART_M = 1000.0
#: Number of obstacle places in each part; minimum distance to the intercept point [m].
PLACES, MIN_DISTANCE_M = 5, 500.0
#: Search range before and after the edges of an obstacle [m].
SEARCH_MARGIN_M = 150.0
#: Additional distance before the first window [m].
LEAD_M = 20.0
MIN_CLEARANCE_M = 10.0
#: Terrain to each side of a flight [m], wider than any beam; maximum spacing of its posts [m].
SIDE_REACH_M, MAX_CELL_M = 400.0, 5.0


def detectable_obstacles(
    ground: TerrainGround,
    plan: ReferenceOptions,
    reference: ApproachReference,
    progress: Progress,
    run_all: TaskRunner = run_serially,
) -> Obstacles | None:
    """The table of the smallest obstacles; None if obstacle_runs is 0."""
    if not plan.obstacle_runs:
        return None
    parts = [PART_M * k for k in range(math.ceil(plan.s_max / PART_M), 0, -1)]
    cells = [(width, part) for width in WIDTHS_M for part in parts]
    task = functools.partial(min_obstacle_height, ground, plan, reference)
    found = run_all(task, cells, functools.partial(progress, "obstacles"))
    agl = ground.path.alt_path(reference.s) - reference.z_ref
    heights = [agl[(reference.s > part - PART_M) & (reference.s <= min(part, plan.s_max))] for part in parts]
    return Obstacles(
        pd=PD,
        width_m=WIDTHS_M,
        s_m=tuple(parts),
        agl_m=tuple(round(float(np.median(part))) for part in heights),
        height_m=tuple(tuple(found[k : k + len(parts)]) for k in range(0, len(found), len(parts))),
        runs=plan.obstacle_runs,
    )


def max_misses(runs: int) -> int:
    """Maximum number of misses of ``runs`` flights that proves the Pd; -1 if even 0 does not."""
    total, m = 0.0, -1
    while (total := total + math.comb(runs, m + 1) * (1.0 - PD) ** (m + 1) * PD ** (runs - m - 1)) <= 1.0 - CONFIDENCE:
        m += 1
    return m


def lowest_rung(is_detected: Callable[[int, int], bool], rungs: int, runs: int, missed: int) -> int:
    """The lowest rung with at most ``missed`` runs without a detection; ``rungs`` if there is none.

    is_detected : for run and rung; a run with a detection at a rung has one at all higher rungs.  About one call a run
    """
    needed, lowest = list[int](), 0
    for run in range(runs):
        rung = lowest
        while rung < rungs and not is_detected(run, rung):
            rung += 1
        needed = sorted((*needed, rung), reverse=True)[: missed + 1]
        lowest = needed[missed] if len(needed) > missed else 0
        if lowest == rungs:
            break
    return lowest


def min_obstacle_height(
    ground: TerrainGround, plan: ReferenceOptions, reference: ApproachReference, cell: tuple[float, float]
) -> float:
    """Smallest detectable height [m].  cell : width, start of the part of the track [m]"""
    width, part = cell
    before = width / 2 + SEARCH_MARGIN_M + reference.header.profile.window_m + LEAD_M
    first, last = max(part - PART_M, MIN_DISTANCE_M), min(part, plan.s_max - before)
    missed = max_misses(plan.obstacle_runs)
    if first >= last or missed < 0:
        return math.inf
    places = plan.rng(7, round(part)).uniform(first, last, PLACES)
    sites = [
        _ObstacleSite(ground, reference, float(place), width, ground.terrains[k % len(ground.terrains)])
        for k, place in enumerate(places)
    ]
    is_detected = _ObstacleDetection(sites, plan, reference, (round(width), round(part)))
    rung = lowest_rung(is_detected, len(HEIGHTS_M), plan.obstacle_runs, missed)
    return HEIGHTS_M[rung] if rung < len(HEIGHTS_M) else math.inf


class _ObstacleSite:
    """The terrain around the place of an obstacle, without and with it."""

    def __init__(
        self, ground: TerrainGround, reference: ApproachReference, place: float, width: float, terrain: Terrain
    ) -> None:
        reach = width / 2 + SEARCH_MARGIN_M
        self.begin = place + reach + reference.header.profile.window_m + LEAD_M
        self.end = max(place - reach, 0.0)
        self.height = float(ground.path.alt_path(place) - np.interp(place, reference.s, reference.z_ref))
        self._ground = ground
        self._bare = terrain_strip(terrain, ground.path, self.begin, self.end)
        box = Obstacle(
            kind="obstacle",
            before_threshold_m=place - ground.path.x_gpi,
            height_m=1.0,
            length_m=width,
            width_m=width,
        )
        raised = add_obstacles(self._bare, ground.path, [box])
        self._box: Array = raised.finest.heights - self._bare.finest.heights

    @functools.lru_cache  # noqa: B019 - lives as long as the few heights of one place
    def with_box(self, height: float) -> TerrainGround:
        """The ground with an obstacle of this height [m]."""
        terrain = self._bare.with_finest(self._bare.finest.heights + height * self._box)
        return replace(self._ground, terrains=(terrain,))


class _ObstacleDetection:
    """Is an obstacle of ``HEIGHTS_M[rung]`` detected on flight ``run``?  The flight is the same for every height."""

    def __init__(
        self,
        sites: Sequence[_ObstacleSite],
        plan: ReferenceOptions,
        reference: ApproachReference,
        stream: tuple[int, int],
    ) -> None:
        self._sites, self._plan, self._reference, self._stream = sites, plan, reference, stream
        self._settings = Approach(profile="", window_m=reference.header.profile.window_m)
        self._scanner = BatchMonitor(reference, self._settings)

    def __call__(self, run: int, rung: int) -> bool:
        site, height = self._sites[run % len(self._sites)], HEIGHTS_M[rung]
        if height > site.height - MIN_CLEARANCE_M:
            return False
        rng = self._plan.rng(8, *self._stream, run)
        approach = simulate(site.with_box(height), site.begin, rng, s_end=site.end)
        over = self._t4(approach) > self._reference.header.limits.t4
        return bool(np.any(over[1:] & over[:-1]))

    def _t4(self, approach: SimulatedApproach) -> Array:
        scan = self._scanner.scan(track_of(approach), approach.vertical_sd)
        if scan is not None:
            return scan.t4
        outputs = run_monitor(ClearanceMonitor(self._reference, self._settings), approach)
        ratios = [output.t4_ratio for output in outputs if output.t4_ratio is not None]
        return np.array(ratios) * self._reference.header.limits.t4


def terrain_strip(terrain: Terrain, path: ApproachPath, begin: float, end: float) -> Terrain:
    """The terrain around the track from begin down to end [m], with posts aligned to those of the finest layer."""
    lat, lon = path.to_geodetic(np.linspace(end, begin, 50), 0.0)
    east, north = terrain.frame.to_local(lat, lon, 0.0)[..., :2].T
    cell = min(float(np.nanmin(terrain.cell(east, north), initial=MAX_CELL_M)), MAX_CELL_M)
    columns, rows = (
        np.arange(math.floor((low - SIDE_REACH_M) / cell), math.ceil((high + SIDE_REACH_M) / cell) + 1) * cell
        for low, high in (
            (east.min() - terrain.finest.east0, east.max() - terrain.finest.east0),
            (north.min() - terrain.finest.north0, north.max() - terrain.finest.north0),
        )
    )
    columns, rows = columns + terrain.finest.east0, rows + terrain.finest.north0
    up = terrain.up(columns[None, :], rows[:, None])
    return Terrain((Layer(up, cell, float(columns[0]), float(rows[0])),), terrain.frame)
