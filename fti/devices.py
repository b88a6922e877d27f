"""Binds the devices of the configuration to drivers with validated options.

An option whose name ends in ``_file`` names a text file; the driver gets its content in the option without the
ending (``dbc_file = "air.dbc"`` becomes ``dbc = "<text>"``), because a driver opens no files.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fti import config as configuration
from fti import drivers
from fti.config import Config, Device, StrictModel
from fti.drivers import Decoder, Driver
from fti.errors import ConfigError, MissingError
from fti.geodesy.formulas import mat_nb

if TYPE_CHECKING:
    from fti.nav.integrity.reference import ApproachReference

FILE_ENDING = "_file"


@dataclass(frozen=True, slots=True)
class BoundDevice:
    """A device of the configuration with its driver and checked options."""

    device: Device
    driver: Driver
    options: StrictModel

    def make_decoder(self) -> Decoder:
        """A fresh decoder."""
        return self.driver.make_decoder(self.options)

    def needs_polling(self) -> bool:
        """The device sends all its data only after requests."""
        return bool(self.driver.on_connect(self.options)) or self.driver.poll(self.options) is not None


def read_text(path: Path) -> str:
    """A text file named in the configuration.  Raises MissingError."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not UTF-8 text"
        raise MissingError(f"{path}: cannot be read: {reason}") from None


def option_files(config: Config) -> dict[str, Path]:
    """The files named by options, by key path."""
    folder = Path(config.path).parent
    return {
        f"device[{i}].options.{key}": folder / value
        for i, device in enumerate(config.device)
        for key, value in device.options.items()
        if key.endswith(FILE_ENDING) and isinstance(value, str)
    }


def read_texts(config: Config) -> dict[str, str]:
    """The content of every file named by options and ``nav.approach``, by key path.  Raises MissingError."""
    texts = _read_option_texts(config)
    if config.nav.approach:
        key = "nav.approach.profile"
        texts[key] = _read_named(config, key, Path(config.nav.approach.profile))
    return texts


def _read_option_texts(config: Config) -> dict[str, str]:
    return {key: _read_named(config, key, path) for key, path in option_files(config).items()}


def _read_named(config: Config, key: str, path: Path) -> str:
    try:
        return read_text(path)
    except MissingError as error:
        raise MissingError(f"{config.path}: {key}: {error}") from None


def bind_devices(config: Config, texts: Mapping[str, str] | None = None) -> list[BoundDevice]:
    """Every device with driver and checked options.  texts : see ``read_texts``; None: read the files of options.

    Raises ConfigError with file, key path, value and the allowed values.
    """
    found = _read_option_texts(config) if texts is None else texts
    with configuration.error_lines(config.path, config.text):
        binders = [partial(_bind, config, i, device, found) for i, device in enumerate(config.device)]
        return configuration.check_all(binders)


def _bind(config: Config, index: int, device: Device, texts: Mapping[str, str]) -> BoundDevice:
    key = f"device[{index}]"
    try:
        driver = drivers.load(device.driver)
    except ValueError as error:
        raise ConfigError(f"{config.path}: {key}.driver = {device.driver!r}: {error}") from None
    kind = next(link.kind for link in config.link if link.name == device.link)
    if kind not in driver.CARRIERS:
        carriers = ", ".join(sorted(driver.CARRIERS))
        raise ConfigError(
            f"{config.path}: {key}.link = {device.link!r}: is a {kind} link; {device.driver} supports {carriers}"
        )
    if twice := [name for name in device.options if f"{name}{FILE_ENDING}" in device.options]:
        raise ConfigError(
            f"{config.path}: {key}.options: {twice[0]} and {twice[0]}{FILE_ENDING}: only one of them is allowed"
        )
    if blank := [name for name in device.options if not texts.get(f"{key}.options.{name}", "full").strip()]:
        # Without a text the driver would use its built-in default.
        raise ConfigError(f"{config.path}: {key}.options.{blank[0]} = {device.options[blank[0]]!r}: the file is empty")
    table = _with_texts(device.options, f"{key}.options", texts)
    options = configuration.bind(driver.Options, table, config.path, f"{key}.options")
    bound = BoundDevice(device, driver, options)
    _try(config, key, bound.make_decoder)
    return bound


def _with_texts(options: Mapping[str, Any], key: str, texts: Mapping[str, str]) -> dict[str, Any]:
    named = {name[: -len(FILE_ENDING)]: texts[f"{key}.{name}"] for name in options if f"{key}.{name}" in texts}
    return {**options, **named}


def _try(config: Config, key: str, make: Callable[[], object]) -> None:
    """Turn a ValueError of a driver (a wrong DBC, for example) into a ConfigError."""
    try:
        make()
    except ValueError as error:
        raise ConfigError(f"{config.path}: {key}.options: {error}") from None


def check_inertial(config: Config, devices: Sequence[BoundDevice]) -> None:
    """Check that the IMU of the filter provides inertial data.  Raises ConfigError."""
    name = config.nav.filter.imu if config.nav.filter else None
    unit = next((bound for bound in devices if bound.device.name == name), None)
    if unit is not None and not drivers.is_inertial(unit.driver):
        able = ", ".join(other for other in drivers.names() if drivers.is_inertial(drivers.load(other)))
        text = f"nav.filter.imu = {name!r}: {unit.device.driver} provides no inertial data; drivers that do: {able}"
        raise ConfigError(f"{config.path}: {text}")


def check_beams(config: Config, devices: Sequence[BoundDevice]) -> None:
    """Check that multi-beam altimeters give ranges of beams.  Raises ConfigError."""
    for i, bound in enumerate(devices):
        if configuration.is_multibeam(bound.device) and not drivers.has_beams(bound.driver):
            able = ", ".join(other for other in drivers.names() if drivers.has_beams(drivers.load(other)))
            text = f"{bound.device.driver} gives no ranges of beams; drivers that do: {able}"
            raise ConfigError(f"{config.path}: device[{i}].altimeter.kind = 'multibeam': {text}")


def gives_scans(bound: BoundDevice) -> bool:
    """Does the device give scans, with a direction and a time of each point?"""
    return drivers.has_turns(bound.driver) or getattr(bound.options, "array", None) is not None


#: Longest look of a scanner that turns [s].
MAX_TURN_S = 0.2
#: Shortest exposure of a strip of lines [s].
MIN_STRIP_S = 0.2
#: The front line scanner looks so much further ahead than the rear one, in heights above ground; both look down.
MIN_DISTANCE_AHEAD, MIN_DOWN = 0.05, 0.5


def check_scan_drift(config: Config, devices: Sequence[BoundDevice]) -> None:
    """Check that the devices of ``[nav.scan_drift]`` give looks at the ground.  Raises ConfigError."""
    settings = config.nav.scan_drift
    if settings is None:
        return
    table, by_name = f"{config.path}: nav.scan_drift", {bound.device.name: bound for bound in devices}
    for key, name in zip(("device", "second_device"), settings.devices, strict=False):
        bound = by_name[name]
        if not gives_scans(bound):
            able = ", ".join(other for other in drivers.names() if drivers.has_turns(drivers.load(other)))
            text = f"{bound.device.driver} gives no scans; drivers that do: {able}, and binary_struct with "
            raise ConfigError(f"{table}.{key} = {name!r}: {text}device.options.array")
        _check_look(settings, bound, table, key)
    if settings.second_device is not None:
        _check_front(table, *(by_name[name].device for name in settings.devices))


def _check_look(settings: configuration.ScanDriftTable, bound: BoundDevice, table: str, key: str) -> None:
    """Check that the scans of a device are looks, alone or with those of the other device."""
    name, array, exposure = bound.device.name, getattr(bound.options, "array", None), settings.exposure_s
    is_line = array is not None and array.grid == "lines"
    if is_line and settings.second_device is None:
        text = "gives lines, which do not overlap with those of an earlier time; array.grid must be 'image', or "
        raise ConfigError(f"{table}.{key} = {name!r}: {text}second_device a line scanner that looks back")
    if not is_line and settings.second_device is not None:
        text = "gives no lines; only two line scanners (array.grid = 'lines') see the ground one after the other"
        raise ConfigError(f"{table}.{key} = {name!r}: {text}")
    if array is None and not 0.0 < exposure <= MAX_TURN_S:
        text = f"a scan of {bound.device.driver} is a part of a turn; must be the duration of a look, for example 0.1"
        raise ConfigError(f"{table}.exposure_s = {exposure:g}: {text}, at most {MAX_TURN_S:g}")
    if is_line and exposure < MIN_STRIP_S:
        text = f"a scan of {name} is a line; must be the duration of a strip, {MIN_STRIP_S:g} to 1.5"
        raise ConfigError(f"{table}.exposure_s = {exposure:g}: {text}")
    if array is not None and not is_line and exposure > 0.0:
        raise ConfigError(f"{table}.exposure_s = {exposure:g}: a scan is a whole image; must be 0")


def _check_front(table: str, front: Device, rear: Device) -> None:
    """Check that both scanners look down, and the front one further ahead, by the middle of their lines."""
    ahead = []
    for key, device in (("device", front), ("second_device", rear)):
        (forward, _, down) = (row[2] for row in mat_nb(*(math.radians(angle) for angle in device.rpy_bs_deg)))
        if down < MIN_DOWN:
            text = "the middle of its lines is not below the aircraft; check rpy_bs_deg, at most 60 deg from down"
            raise ConfigError(f"{table}.{key} = {device.name!r}: {text}")
        ahead.append(forward / down)
    if ahead[0] - ahead[1] < MIN_DISTANCE_AHEAD:
        text = f"its lines are no further ahead than those of {rear.name}; check rpy_bs_deg of both"
        raise ConfigError(f"{table}.device = {front.name!r}: {text}")


def check_alert_limits(config: Config) -> None:
    """Check that a position can be valid under ``[nav.alert_limits]``.  Raises ConfigError.

    Only called before a flight, as ``check_reference``; the protection levels of a flight are not known before it.
    """
    aided = config.nav.filter is not None and bool(config.nav.filter.gnss)
    if config.nav.alert_limits.compared and not aided:
        raise ConfigError(
            f"{config.path}: nav.alert_limits.compared = true: no position would ever be valid: positions are "
            "compared only with [nav.filter], which has no gnss"
        )


@dataclass(frozen=True, slots=True)
class LinkTransmissions:
    """Data that the recorder sends on a link by itself, without interpreting them."""

    on_connect: tuple[bytes, ...]
    polls: tuple[tuple[float, bytes], ...]  # (period [s], bytes)


def link_transmissions(link: str, devices: Sequence[BoundDevice]) -> LinkTransmissions:
    """The data for the devices of a link: after every connect, and repeated polls."""
    here = [d for d in devices if d.device.link == link]
    polls = [d.driver.poll(d.options) for d in here]
    return LinkTransmissions(
        on_connect=tuple(data for d in here for data in d.driver.on_connect(d.options)),
        polls=tuple(q for q in polls if q is not None),
    )


def check_reference(config: Config, texts: Mapping[str, str]) -> ApproachReference | None:
    """``parse_reference`` before a flight.  Raises ConfigError for an alert limit that the reference cannot keep."""
    reference, settings = parse_reference(config, texts), config.nav.approach
    if reference is not None and settings is not None:
        from fti.nav.integrity.reference import check_alert_limit  # noqa: PLC0415 - as in parse_reference

        check_alert_limit(reference, settings.alert_v_m, settings.profile, config.path)
    return reference


def parse_reference(config: Config, texts: Mapping[str, str]) -> ApproachReference | None:
    """The reference profile of ``nav.approach``, checked against its settings; None without an approach.

    Raises ConfigError.
    """
    settings = config.nav.approach
    if settings is None:
        return None
    # imports numpy, which would delay the start of the recording
    from fti.nav.integrity.reference import ApproachReference, check_settings  # noqa: PLC0415

    if "nav.approach.profile" not in texts:  # a recorded configuration
        raise ConfigError(f"{config.path}: nav.approach.profile = {settings.profile!r}: its text is not attached")
    reference = ApproachReference.parse(texts["nav.approach.profile"], settings.profile)
    check_settings(reference, settings, config.path)
    return reference
