"""Limits of a configuration that never refuse anything, or that refuse correct samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fti.config import Altimeter, Config, is_multibeam
from fti.nav.altimetry.validity import deviation_gate, is_conclusive
from fti.nav.filter.navigator import MAX_SD_M
from fti.nav.plausibility.heading import SPEED_RATIO
from fti.nav.protection import K_RADIAL

#: Post spacing over gate: a ridge half way between two posts, with sides of 2 %, is then as high as the gate.
MAX_SPACING_PER_GATE = 100.0
#: Largest amount of the geoid undulation, EGM96: -107 m south of India (Lemoine et al. 1998, NASA/TP-1998-206861).
MAX_UNDULATION_M = 107.0
#: Receivers that are not export controlled give no output at higher speeds (MTCR Annex, item 11.A.3).
MAX_RECEIVER_SPEED_MPS = 600.0
#: More than half the length and half the span of the largest airliner (Airbus A380: 72.7 m, 79.8 m).
MAX_LEVER_ARM_M = 50.0
#: Limits of an altimeter at which no value violates them [deg].
ANGLES = {"max_roll_deg": 180.0, "max_pitch_deg": 90.0, "max_incidence_deg": 90.0}
#: Limits of an altimeter that are tested over known terrain only.
OVER_TERRAIN = ("max_deviation_m", "max_nadir_deviation_m", "max_dispersion", "max_incidence_deg")


def limit_warnings(config: Config, layers: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Sentences that begin with the key.  layers : of the terrain, as ``describe_layers`` gives them"""
    yield from _flight_limits(config)
    for i, device in enumerate(config.device):
        if device.lever_arm_b and max(map(abs, device.lever_arm_b)) > MAX_LEVER_ARM_M:
            arm = ", ".join(f"{value:g}" for value in device.lever_arm_b)
            yield f"device[{i}].lever_arm_b = [{arm}]: longer than {MAX_LEVER_ARM_M:g} m: metres, not millimetres?"
        if device.altimeter is None:
            continue
        key = f"device[{i}].altimeter"
        if device.name in config.nav.altimeters:
            yield from _altimeter_limits(config, key, device.altimeter)
            yield from _coarse_terrain(key, device.altimeter, layers)
        elif is_multibeam(device):
            yield from _unused_beams(config, key, device.name)
        elif config.nav.altimeters:
            yield f"{key}: is not used: {device.name} is not in nav.altimeters; add it, or remove the table"
    yield from _unused_land_cover(config)
    yield from _unused_aiding(config)


def _unused_beams(config: Config, key: str, name: str) -> Iterator[str]:
    ground = config.nav.terrain_position
    if ground is None or ground.altimeter != name:
        yield f"{key}: is not used: [nav.terrain_position] does not name {name}; name it, or remove the table"


def _unused_land_cover(config: Config) -> Iterator[str]:
    """Tables of land cover for another kind of altimeter than that of the position from the ground."""
    ground = config.nav.terrain_position
    device = config.find_device(ground.altimeter) if ground else None
    kind = device.altimeter.kind if device and device.altimeter else None
    for i, table in enumerate(config.nav.terrain.cover if config.nav.terrain else ()):
        if table.altimeter != kind:
            uses = f"uses a {kind} altimeter" if kind else "is not configured"
            key = f"nav.terrain.cover[{i}].altimeter = {table.altimeter!r}"
            yield f"{key}: is not used: [nav.terrain_position] {uses}; change it, or remove the table"


def _flight_limits(config: Config) -> Iterator[str]:
    nav, limits = config.nav, config.nav.limits
    if limits.speed_mps >= MAX_RECEIVER_SPEED_MPS:
        yield (
            f"nav.limits.speed_mps = {limits.speed_mps:g}: refuses nothing: receivers give no position above "
            f"{MAX_RECEIVER_SPEED_MPS:g} m/s; set the largest speed of the aircraft"
        )
    if nav.attitude and SPEED_RATIO * limits.wind_mps >= limits.speed_mps:
        yield (
            f"nav.limits.wind_mps = {limits.wind_mps:g}: headings are compared with the track only above "
            f"{SPEED_RATIO:g} times this wind, and speed_mps is {limits.speed_mps:g}: no heading is ever refused by "
            f"its track; set less than {limits.speed_mps / SPEED_RATIO:.3g}"
        )
    if limits.undulation_m >= MAX_UNDULATION_M:
        yield (
            f"nav.limits.undulation_m = {limits.undulation_m:g}: refuses nothing: no undulation of the geoid exceeds "
            f"{MAX_UNDULATION_M:g} m; the default is 5"
        )
    if nav.filter and nav.alert_limits.position_m >= K_RADIAL * MAX_SD_M:
        yield (
            f"nav.alert_limits.position_m = {nav.alert_limits.position_m:g}: refuses nothing: above "
            f"{K_RADIAL * MAX_SD_M:g} m the filter has no position; set the error that the flight tolerates"
        )


def _altimeter_limits(config: Config, key: str, altimeter: Altimeter) -> Iterator[str]:
    for name, largest in ANGLES.items():
        value = getattr(altimeter, name)
        if value is not None and value >= largest:
            yield f"{key}.{name} = {value:g}: refuses nothing: no such angle exceeds {largest:g} deg; set a smaller one"
    if config.nav.terrain is None:
        if unused := [name for name in OVER_TERRAIN if name in altimeter.model_fields_set]:
            yield (
                f"{key}.{unused[0]}: refuses nothing without known terrain"
                f"{''.join(f', nor does {name}' for name in unused[1:])}; add [nav.terrain]"
            )
    elif (gate := deviation_gate(0.0, altimeter)) >= altimeter.range_m[1]:
        yield (
            f"{key}.max_deviation_m = {gate:g}: refuses nothing: no range exceeds {altimeter.range_m[1]:g} m "
            "(range_m); set a smaller one"
        )


def _coarse_terrain(key: str, altimeter: Altimeter, layers: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Whether the finest layer allows a comparison, by its known sigma and by the distance of its posts."""
    if not layers:
        return
    finest, gate = min(layers, key=lambda layer: float(layer["cell_m"])), deviation_gate(0.0, altimeter)
    if not is_conclusive(finest["sigma_m"], altimeter):
        yield (
            f"{key}: is never compared with the ground: three sigma of the terrain, 3 x {finest['sigma_m']:.2f} m, "
            f"exceed twice its max_deviation_m of {gate:g} m; use better elevation files, a finer cell_m or a larger "
            "max_deviation_m"
        )
    elif finest["cell_m"] >= MAX_SPACING_PER_GATE * gate:
        yield (
            f"{key}: posts of the terrain are {finest['cell_m']:g} m apart, its max_deviation_m is {gate:g} m: slopes "
            f"of {200.0 * gate / finest['cell_m']:.2g} % between two posts refuse correct ranges; use finer elevation "
            "files or a larger max_deviation_m"
        )


def _unused_aiding(config: Config) -> Iterator[str]:
    nav = config.nav
    if nav.terrain is not None:
        return
    if nav.filter and nav.filter.altimeters:
        yield "nav.filter.altimeters: never aid: they need known terrain; add [nav.terrain]"
    if nav.radio and nav.radio.altimeter:
        yield "nav.radio.altimeter: is never used: it needs known terrain; add [nav.terrain]"
