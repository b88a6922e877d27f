"""Judges elevation models with the altimeters of a recorded session."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fti.config import Config, Device
from fti.errors import ConfigError, MissingError
from fti.geodesy.local import LocalFrame
from fti.logger.reading.recording import Recording
from fti.post.reprocess import recorded_setup
from fti.post.terrain_judge.fit import REACH_M
from fti.post.terrain_judge.judge import AltimeterResult, judge
from fti.post.terrain_judge.samples import FlightRecord, RangeSamples, read_flight
from fti.terrain.files.catalogue import list_files
from fti.terrain.files.land_cover import land_cover_at
from fti.terrain.files.open_terrain import open_terrain
from fti.terrain.files.vertical import OTHER_FILES, datums_of
from fti.terrain.terrain import Terrain

#: Altimeters with fewer ranges are left out.
MIN_RANGES = 50
#: Ground around the track beside the longest range and the search [m]: the way of a lag.
MARGIN_M = 200.0


@dataclass(frozen=True)
class MapFiles:
    """Elevation models and land cover, as the command gets them.

    models   : a file each, or a folder with files
    vertical : datum of files that state none, by file; ``*`` for all others;  cell_m : between posts; None: the files'
    """

    models: Sequence[str]
    vertical: Mapping[str, str]
    cell_m: float | None = None
    land_cover: str | None = None


@dataclass(frozen=True)
class SessionResult:
    """The result of each altimeter.  position_sources : devices that the shifts are relative to"""

    position_sources: tuple[str, ...]
    altimeters: tuple[AltimeterResult, ...]


def judge_session(
    recording: Recording, session: Path, files: MapFiles, progress: Callable[[str, float], None]
) -> SessionResult:
    """Compare elevation models with the ranges of all altimeters with one beam.

    progress : gets a step and its completed share
    Raises MissingError without ranges and positions, ConfigError for files that cannot be compared.
    """
    if len(set(files.models)) != len(files.models):
        raise ConfigError(f"{', '.join(files.models)}: each elevation model must be given once")
    config = recorded_setup(recording, session).config
    flight = read_flight(recording)
    devices = _altimeters(config, flight, session)
    frame = _frame(flight, devices)
    samples = {device.name: flight.samples(device, frame) for device in devices}
    samples = {name: each for name, each in samples.items() if len(each) >= MIN_RANGES}
    if not samples:
        raise MissingError(f"{session}: no altimeter has {MIN_RANGES} ranges with position and attitude of devices")
    terrains = _open(files, frame, list(samples.values()), progress)
    results = list[AltimeterResult]()
    for name, each in samples.items():
        classes = None
        if files.land_cover is not None:
            lat, lon, _ = frame.to_geodetic(each.measured(0.0))
            classes = land_cover_at(files.land_cover, lat, lon)
        results.append(judge(name, each, terrains, classes, lambda share: progress("comparing", share)))
    return SessionResult(flight.position_sources, tuple(results))


def _altimeters(config: Config, flight: FlightRecord, session: Path) -> list[Device]:
    """Devices with one beam that have heights."""
    devices = [device for name in flight.values if (device := config.find_device(name)) and device.altimeter]
    found = [device for device in devices if device.altimeter and device.altimeter.kind != "multibeam"]
    if not found:
        raise MissingError(f"{session}: has no heights of an altimeter with one beam; run fti reprocess")
    if not len(flight.poses):
        raise MissingError(f"{session}: has no position with altitude and attitude from a device; run fti reprocess")
    return found


def _frame(flight: FlightRecord, devices: Sequence[Device]) -> LocalFrame:
    """At the middle of the positions at which ranges were measured."""
    t_ns = np.concatenate([flight.values[device.name][:, 0] for device in devices])
    lat = np.interp(t_ns, flight.poses[:, 0], flight.poses[:, 1])
    lon = np.interp(t_ns, flight.poses[:, 0], np.unwrap(flight.poses[:, 2]))
    middle = [float(0.5 * (place.min() + place.max())) for place in (lat, lon)]
    return LocalFrame(middle[0], middle[1], 0.0)


def _open(
    files: MapFiles, frame: LocalFrame, samples: Sequence[RangeSamples], progress: Callable[[str, float], None]
) -> dict[str, Terrain]:
    """The elevation models around the track.  Raises as ``open_terrain``; ConfigError for a datum of no file."""
    extent = max(float(np.abs(each.track.at(each.t)[0][:, :2]).max()) for each in samples)
    longest = max(float(each.ranges.max()) for each in samples)
    paths = {model: list_files([model]) for model in files.models}
    known = {OTHER_FILES, *(path for each in paths.values() for path in each)}
    if unknown := [name for name in files.vertical if name not in known]:
        raise ConfigError(f"--vertical {unknown[0]}={files.vertical[unknown[0]]}: is not one of the elevation files")
    terrains = dict[str, Terrain]()
    for number, (model, names) in enumerate(paths.items()):
        terrains[model] = open_terrain(
            names,
            centre=(frame.lat0, frame.lon0),
            radius_m=extent + longest + REACH_M + MARGIN_M,
            cell_m=files.cell_m,
            vertical=datums_of(files.vertical, names),
        )
        progress("reading elevation", (number + 1) / len(paths))
    return terrains
