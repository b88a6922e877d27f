"""Reads a configuration, checks references between tables, makes paths absolute; applies changes of commands."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from fti.config.binding import bind
from fti.config.error_lines import check_all, error_lines
from fti.config.parsing import MAX_TOML_BYTES, decode_text, parse_toml
from fti.config.tables import CanLink, Config, Device, Nav, SerialLink, TerrainFiles, UdpLink, is_multibeam
from fti.errors import ConfigError, MissingError, did_you_mean

#: Keys of ``[nav.terrain]`` that need ``files``.
FILE_KEYS = ("vertical", "centre_deg", "radius_m", "memory_mb", "cell_m", "land_cover", "cover", "file")

#: GDAL's prefix of a file in a zip.
VSIZIP = "/vsizip/"
#: Names of navigation's own sources; a device of such a name would be ambiguous.
RESERVED_DEVICE_NAMES = ("filter", "radio", "vertical")
#: An altimeter is mounted less than 85 degrees from straight down: cosine of that.
MIN_DOWN_COMPONENT = math.cos(math.radians(85.0))


def read_toml(path: Path) -> tuple[dict[str, Any], str]:
    """A TOML file as a table, and its text.  Raises MissingError or ConfigError."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_TOML_BYTES + 1)
    except OSError as error:
        raise MissingError(f"{path}: cannot be read: {error.strerror}") from None
    text = decode_text(data, str(path))
    return parse_toml(text, str(path)), text


def load(path: str | Path) -> Config:
    """Read, check and freeze a configuration.  Raises ConfigError or MissingError."""
    file = Path(path)
    table, text = read_toml(file)
    return parse(table, text, file)


def parse(table: Mapping[str, Any], text: str, file: Path) -> Config:
    """The configuration in a TOML table; file : its path (for messages and relative paths)."""
    for reserved in ("path", "text"):
        if reserved in table:
            raise ConfigError(f"{file}: {reserved}: there is no such key")
    with error_lines(str(file), text):
        config = bind(Config, {**table, "path": str(file), "text": text}, str(file))
        _check_references(config, str(file))
        return _resolve_paths(config, file.parent)


def _check_references(config: Config, file: str) -> None:
    links = [link.name for link in config.link]
    devices = [device.name for device in config.device]
    _check_unique(links, file, "link")
    _check_unique(devices, file, "device")
    if config.session.mode == "snapshot" and config.snapshot is None:
        raise ConfigError(f"{file}: session.mode = 'snapshot': needs a [snapshot] table: before_s, after_s, max_mb")
    checks: list[Callable[[], None]] = [partial(_check_device, i, links, config, file) for i in range(len(devices))]
    checks += [
        partial(_check_roles, config.nav, devices, file),
        partial(_check_terrain, config.nav.terrain, file),
        partial(_check_filter, config, devices, file),
        partial(_check_radio, config.nav, devices, file),
        partial(_check_terrain_position, config, file),
        partial(_check_scan_drift, config.nav, devices, file),
        partial(_check_altimeters, config, file),
    ]
    check_all(checks)


def _check_device(index: int, links: list[str], config: Config, file: str) -> None:
    device, key = config.device[index], f"{file}: device[{index}]"
    if device.link not in links:
        hint = did_you_mean(device.link, links)
        raise ConfigError(f"{key}.link = {device.link!r}: unknown link; configured: {_join_names(links)}{hint}")
    if (altimeter := device.altimeter) and not altimeter.range_m[0] < altimeter.range_m[1]:
        limits = list(altimeter.range_m)
        raise ConfigError(f"{key}.altimeter.range_m = {limits}: the first must be below the second")
    if altimeter and _down_component(device) < MIN_DOWN_COMPONENT:
        raise ConfigError(
            f"{key}.rpy_bs_deg = {list(device.rpy_bs_deg)}: its altimeter would not point down; roll and pitch "
            "together must turn the beam by less than 85 degrees from straight down"
        )


def _check_altimeters(config: Config, file: str) -> None:
    for device in config.device:
        if device.name in config.nav.altimeters and device.altimeter is None:
            raise ConfigError(f"{file}: nav.altimeters: device {device.name!r} needs a [device.altimeter] table")
        if device.name in config.nav.altimeters and is_multibeam(device):
            raise ConfigError(
                f"{file}: nav.altimeters: {device.name!r} is a multi-beam altimeter, which gives no height; only "
                "[nav.terrain_position] uses it"
            )


def _down_component(device: Device) -> float:
    """Down component of the beam of a sensor in a level aircraft: cos(roll) cos(pitch) of its mounting; 1: nadir."""
    roll, pitch, _ = map(math.radians, device.rpy_bs_deg)
    return math.cos(roll) * math.cos(pitch)


def _check_roles(nav: Nav, devices: list[str], file: str) -> None:
    for role in ("attitude", "position", "altimeters"):
        for name in getattr(nav, role):
            if name not in devices:
                raise ConfigError(f"{file}: nav.{role}: {_unknown_device(name, devices)}")
            if name in RESERVED_DEVICE_NAMES and role != "altimeters":
                text = f"reserved name; here a device must not have the names {_join_names(RESERVED_DEVICE_NAMES)}"
                raise ConfigError(f"{file}: nav.{role}: {name!r}: {text}")


def _check_radio(nav: Nav, devices: list[str], file: str) -> None:
    if nav.radio is None:
        return
    if nav.radio.receiver is not None and nav.radio.receiver not in devices:
        raise ConfigError(f"{file}: nav.radio.receiver: {_unknown_device(nav.radio.receiver, devices)}")
    if nav.radio.altimeter is not None and nav.radio.altimeter not in nav.altimeters:
        text = f"nav.radio.altimeter: {nav.radio.altimeter!r} is not in nav.altimeters"
        raise ConfigError(f"{file}: {text}; allowed: {_join_names(nav.altimeters)}")


def _check_terrain_position(config: Config, file: str) -> None:
    nav = config.nav
    if nav.terrain_position is None:
        return
    if missing := [table for table in ("filter", "terrain") if getattr(nav, table) is None]:
        raise ConfigError(f"{file}: nav.terrain_position: needs [nav.{missing[0]}]")
    allowed = [*nav.altimeters, *(device.name for device in config.device if is_multibeam(device))]
    if nav.terrain_position.altimeter not in allowed:
        text = f"{nav.terrain_position.altimeter!r} is neither in nav.altimeters nor a multi-beam altimeter"
        raise ConfigError(f"{file}: nav.terrain_position.altimeter: {text}; allowed: {_join_names(allowed)}")


def _check_scan_drift(nav: Nav, devices: list[str], file: str) -> None:
    settings, table = nav.scan_drift, f"{file}: nav.scan_drift"
    if settings is None:
        return
    if nav.filter is None or not nav.filter.gnss:
        raise ConfigError(f"{table}: needs [nav.filter] with gnss: the drift is calibrated with satellites")
    for key, name in (("device", settings.device), ("second_device", settings.second_device)):
        if name is not None and name not in devices:
            raise ConfigError(f"{table}.{key}: {_unknown_device(name, devices)}")
    if settings.device == settings.second_device:
        raise ConfigError(f"{table}.second_device = {settings.device!r}: is the device; must be the rear line scanner")


def _check_filter(config: Config, devices: list[str], file: str) -> None:
    nav = config.nav
    if nav.filter is None:
        return
    named = {"imu": (nav.filter.imu,), "gnss": nav.filter.gnss, "baro": nav.filter.baro}
    single = {"airspeed": nav.filter.airspeed, "heading": nav.filter.heading}
    named |= {key: (name,) for key, name in single.items() if name is not None}
    for key, names in named.items():
        if unknown := [name for name in names if name not in devices]:
            raise ConfigError(f"{file}: nav.filter.{key}: {_unknown_device(unknown[0], devices)}")
    if nav.filter.heading is not None and nav.filter.declination_deg is None:
        text = "missing; nav.filter.heading needs it: -180 to 180, magnetic north east of true north is positive"
        raise ConfigError(f"{file}: nav.filter.declination_deg: {text}")
    if nav.filter.heading is None and nav.filter.declination_deg is not None:
        raise ConfigError(f"{file}: nav.filter.declination_deg: needs nav.filter.heading, which is missing")
    for i, device in enumerate(config.device):
        if device.name == nav.filter.imu and device.altimeter and any(device.rpy_bs_deg):
            raise ConfigError(
                f"{file}: device[{i}].rpy_bs_deg = {list(device.rpy_bs_deg)}: would also rotate the inertial unit "
                "of nav.filter; define a separate [[device]] for the altimeter on the same link"
            )
    if other := [name for name in nav.filter.altimeters if name not in nav.altimeters]:
        allowed = _join_names(nav.altimeters)
        raise ConfigError(f"{file}: nav.filter.altimeters: {other[0]!r} is not in nav.altimeters; allowed: {allowed}")


def _check_terrain(terrain: TerrainFiles | None, file: str) -> None:
    if terrain is None:
        return
    if bool(terrain.files) == bool(terrain.scene):
        raise ConfigError(f"{file}: nav.terrain: needs exactly one of files and scene")
    if terrain.files and terrain.vertical is None:
        raise ConfigError(f"{file}: nav.terrain.vertical: missing; it must be given: ellipsoid, egm96 or egm2008")
    if (terrain.centre_deg is None) != (terrain.radius_m is None):
        raise ConfigError(f"{file}: nav.terrain: centre_deg and radius_m: set both, or neither to use the whole files")
    if terrain.memory_mb is not None and terrain.centre_deg is not None:
        raise ConfigError(f"{file}: nav.terrain: needs only one of memory_mb and centre_deg with radius_m")
    if terrain.scene and (extra := [key for key in FILE_KEYS if getattr(terrain, key) not in (None, ())]):
        raise ConfigError(f"{file}: nav.terrain.{extra[0]}: not allowed with scene, only with files")
    _check_land_cover(terrain, file)
    for i, table in enumerate(terrain.file):
        if table.vertical is None and table.sd_m is None and table.date is None:
            raise ConfigError(f"{file}: nav.terrain.file[{i}]: needs at least one of vertical, sd_m and date")


def _check_land_cover(terrain: TerrainFiles, file: str) -> None:
    if (terrain.land_cover is None) != (not terrain.cover):
        missing = "cover" if terrain.land_cover else "land_cover"
        raise ConfigError(
            f"{file}: nav.terrain.{missing}: missing; land_cover and [[nav.terrain.cover]] need each other"
        )
    for i, cover in enumerate(terrain.cover):
        surface = {"bias_m", "sd_m"} & cover.model_fields_set
        if not surface and not cover.excluded:
            raise ConfigError(f"{file}: nav.terrain.cover[{i}]: needs bias_m, sd_m or excluded = true")
        if surface and cover.excluded:
            raise ConfigError(f"{file}: nav.terrain.cover[{i}].excluded: not allowed with {min(surface)}")
    pairs = [(table.altimeter, number) for table in terrain.cover for number in table.classes]
    if twice := [pair for k, pair in enumerate(pairs) if pair in pairs[:k]]:
        kind, number = twice[0]
        raise ConfigError(f"{file}: nav.terrain.cover: class {number} of a {kind} is named twice")


def _check_unique(names: list[str], file: str, kind: str) -> None:
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ConfigError(f"{file}: {kind}[{i}].name = {name!r}: used twice; names must differ")


def _unknown_device(name: str, devices: list[str]) -> str:
    return f"unknown device {name!r}; configured: {_join_names(devices)}{did_you_mean(name, devices)}"


def _join_names(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


def _resolve_paths(config: Config, folder: Path) -> Config:
    def absolute(text: str) -> str:
        return os.path.abspath(folder / text)  # noqa: PTH100 - without "..", symbolic links kept

    def elevation(text: str) -> str:
        """Keep GDAL's virtual paths unchanged (``//`` is significant); the path of a zip may be relative."""
        inside = text.removeprefix(VSIZIP)
        if text.startswith("/vsi"):
            return text if inside == text or inside.startswith(("/", "{")) else VSIZIP + absolute(inside)
        return absolute(text)

    nav = config.nav
    if nav.terrain:
        files = tuple(elevation(f) for f in nav.terrain.files)
        tables = tuple(table.model_copy(update={"path": elevation(table.path)}) for table in nav.terrain.file)
        changes: dict[str, Any] = {"files": files, "file": tables}
        if nav.terrain.land_cover is not None:
            changes["land_cover"] = elevation(nav.terrain.land_cover)
        nav = nav.model_copy(update={"terrain": nav.terrain.model_copy(update=changes)})
    if nav.approach:
        approach = nav.approach.model_copy(update={"profile": absolute(nav.approach.profile)})
        nav = nav.model_copy(update={"approach": approach})
    publish = config.publish.with_paths(absolute) if config.publish else None
    session = config.session.model_copy(update={"directory": absolute(config.session.directory)})
    if session.fallback is not None:
        session = session.model_copy(update={"fallback": absolute(session.fallback)})
        if session.fallback == session.directory:
            fallback = config.session.fallback
            raise ConfigError(f"{config.path}: session.fallback = {fallback!r}: must not be session.directory itself")
    return config.model_copy(update={"nav": nav, "session": session, "publish": publish})


def with_links(config: Config, folder: str | Path) -> Config:
    """The same configuration with every serial and slcan port at ``folder/<link>``, where an emulator creates them."""

    def relocate(link: SerialLink | UdpLink | CanLink) -> SerialLink | UdpLink | CanLink:
        path = str(Path(folder).absolute() / link.name)
        if isinstance(link, SerialLink):
            return link.model_copy(update={"port": path})
        if isinstance(link, CanLink) and link.interface == "slcan":
            return link.model_copy(update={"channel": path})
        return link

    return config.model_copy(update={"link": tuple(relocate(link) for link in config.link)})


def with_session(config: Config, **changes: Any) -> Config:
    """The same configuration with keys of ``[session]`` replaced (``directory``, ``origin``)."""
    return config.model_copy(update={"session": config.session.model_copy(update=changes)})
