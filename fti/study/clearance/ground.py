"""Ground of the study ``clearance``: its references, and ground that was not used for their limits."""

from __future__ import annotations

import functools
import math

from fti.example_files import SCENARIOS
from fti.hil.approach_reference.approaches import NOMINAL, RA4500, Spread, TerrainGround
from fti.hil.approach_reference.range_map import MappedGround, map_ground
from fti.hil.approach_reference.receivers import ReceiverVariant
from fti.hil.environment import add_obstacles
from fti.hil.tables.fault_types import Obstacle
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.reference import ApproachReference
from fti.terrain.demo_scene import demo_scene
from fti.terrain.terrain import Terrain

PROFILES = SCENARIOS.parent / "profiles"
#: Vegetation that does not occur in the calibration.
VEGETATION = (0.85, 1.15)
#: Receivers that the references do not contain: another pattern, one threshold outside their range (-13 to -3 dB).
RECEIVERS = tuple(
    ReceiverVariant("aperture", math.radians(beam), 10.0 ** (threshold / 10.0), exponent=2.5)
    for threshold in (-14.5, -10.0, -5.0)
    for beam in (38.0, 42.0)
)
#: Obstacles: distance before the intercept point [m], height, width and length [m].
PLACES_M = (1900.0, 2600.0, 3291.0, 4400.0, 6000.0)
OBSTACLES = {
    "obstacle_30": (30.0, 20.0),
    "obstacle_60": (60.0, 60.0),
    "obstacle_75": (75.0, 60.0),
    "obstacle_150": (150.0, 150.0),
}


@functools.cache
def reference() -> ApproachReference:
    """The reference of the demonstration: Pfa 1 %."""
    return _read("demo.csv")


@functools.cache
def strict_reference() -> ApproachReference:
    """The same profile with limits for Pfa 0.1 %."""
    return _read("demo_strict.csv")


def _read(name: str) -> ApproachReference:
    file = PROFILES / name
    return ApproachReference.parse(file.read_text(encoding="utf-8"), str(file))


def promises(kind: str, place: int) -> bool:
    """Whether the reference promises detection of the obstacle at this place."""
    height, width = OBSTACLES[kind]
    table = reference().header.obstacles
    return table is not None and table.min_height(PLACES_M[place], width) <= height


@functools.cache
def assumed_spread() -> Spread:
    """Nominal approaches that are as bad as the limits assume."""
    stated = reference().header.assumptions
    if stated is None:
        return NOMINAL
    return Spread(
        track=stated.track_sd_m,
        height=stated.height_sd_m,
        nav_horizontal=stated.nav_horizontal_sd_m,
        nav_vertical=stated.nav_vertical_sd_m,
        dem_short=stated.elevation_short_sd_m,
        dem_long=stated.elevation_long_sd_m,
    )


@functools.cache
def path() -> ApproachPath:
    """The approach of both references."""
    return ApproachPath(reference().header.airfield)


@functools.cache
def _terrain(vegetation: float) -> Terrain:
    return demo_scene(vegetation=vegetation)


@functools.cache
def ray_traced_ground() -> TerrainGround:
    """Ground whose ranges are all traced, for receivers that the reference does not contain."""
    return TerrainGround(path(), RA4500, tuple(map(_terrain, VEGETATION)), RECEIVERS)


@functools.cache
def range_map_ground() -> MappedGround:
    """The same ground with tabulated ranges."""
    return map_ground(ray_traced_ground(), reference().header.profile.s_max_m, lambda _: None)


@functools.cache
def with_obstacle(kind: str, place: int) -> TerrainGround:
    """The ground with an obstacle that the reference does not contain."""
    height, width = OBSTACLES[kind]
    before = PLACES_M[place] - path().x_gpi
    box = Obstacle(kind="obstacle", before_threshold_m=before, height_m=height, length_m=width, width_m=width)
    bare = _terrain(VEGETATION[place % len(VEGETATION)])
    return TerrainGround(path(), RA4500, (add_obstacles(bare, path(), [box]),), RECEIVERS)
