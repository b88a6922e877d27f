"""Binding: from the configuration's tables to drivers with checked options.

An option whose name ends in ``_file`` names a text file; the driver gets its content in the option without the
ending (``dbc_file = "air.dbc"`` becomes ``dbc = "<text>"``), because a driver opens no files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fti import config as configuration
from fti import drivers
from fti.config import Config, Device, StrictModel
from fti.drivers import Decoder, Driver
from fti.errors import ConfigError, MissingError

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
        """It says nothing, or not everything, unless something is sent to it."""
        return bool(self.driver.on_connect(self.options)) or self.driver.poll(self.options) is not None


def read_text(path: Path) -> str:
    """A text file named in the configuration.  Raises MissingError."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not UTF-8 text"
        raise MissingError(f"{path}: cannot be read: {reason}") from None


def option_files(config: Config) -> dict[str, Path]:
    """The files that options name, by the key path that names them."""
    folder = Path(config.path).parent
    return {
        f"device[{i}].options.{key}": folder / value
        for i, device in enumerate(config.device)
        for key, value in device.options.items()
        if key.endswith(FILE_ENDING) and isinstance(value, str)
    }


def read_texts(config: Config) -> dict[str, str]:
    """The content of every file that options and ``nav.approach`` name, by key path.  Raises MissingError."""
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
    """Every device with driver and checked options.  texts : see ``read_texts``; when None, what options name is read.

    Raises ConfigError with file, key path, value and what is allowed.
    """
    found = _read_option_texts(config) if texts is None else texts
    return [_bind(config, i, device, found) for i, device in enumerate(config.device)]


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
            f"{config.path}: {key}.link = {device.link!r}: is a {kind} link; {device.driver} speaks on {carriers}"
        )
    if twice := [name for name in device.options if f"{name}{FILE_ENDING}" in device.options]:
        raise ConfigError(f"{config.path}: {key}.options: {twice[0]} and {twice[0]}{FILE_ENDING}: give one of them")
    if blank := [name for name in device.options if not texts.get(f"{key}.options.{name}", "full").strip()]:
        # Without a text the driver would take what is built in.
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
    """What a driver refuses (a wrong DBC, say) is an error of the configuration."""
    try:
        make()
    except ValueError as error:
        raise ConfigError(f"{config.path}: {key}.options: {error}") from None


def check_inertial(config: Config, devices: Sequence[BoundDevice]) -> None:
    """Whether the device that the filter is to rest on gives inertial data.  Raises ConfigError."""
    name = config.nav.filter.imu if config.nav.filter else None
    unit = next((bound for bound in devices if bound.device.name == name), None)
    if unit is not None and not drivers.is_inertial(unit.driver):
        able = ", ".join(other for other in drivers.names() if drivers.is_inertial(drivers.load(other)))
        said = f"nav.filter.imu = {name!r}: {unit.device.driver} gives no inertial data; these drivers do: {able}"
        raise ConfigError(f"{config.path}: {said}")


def check_alert_limits(config: Config) -> None:
    """Whether a position can be valid by ``[nav.alert_limits]``.  Raises ConfigError.

    Asked before a flight alone, as ``check_reference``.  What levels a flight reaches is not known before it.
    """
    aided = config.nav.filter is not None and bool(config.nav.filter.gnss)
    if config.nav.alert_limits.compared and not aided:
        raise ConfigError(
            f"{config.path}: nav.alert_limits.compared = true: no position would ever be valid, as positions are "
            "compared with [nav.filter] alone, and none is aided by gnss"
        )


@dataclass(frozen=True, slots=True)
class LinkTransmissions:
    """What the recorder sends on a link by itself, and never understands."""

    on_connect: tuple[bytes, ...]
    polls: tuple[tuple[float, bytes], ...]  # (period [s], bytes)


def link_transmissions(link: str, devices: Sequence[BoundDevice]) -> LinkTransmissions:
    """What the devices of a link must be told after every connect, and asked again and again."""
    here = [d for d in devices if d.device.link == link]
    questions = [d.driver.poll(d.options) for d in here]
    return LinkTransmissions(
        on_connect=tuple(data for d in here for data in d.driver.on_connect(d.options)),
        polls=tuple(q for q in questions if q is not None),
    )


def check_reference(config: Config, texts: Mapping[str, str]) -> ApproachReference | None:
    """``parse_reference`` before a flight.  Raises ConfigError for an alert limit that the reference cannot keep."""
    reference, settings = parse_reference(config, texts), config.nav.approach
    if reference is not None and settings is not None:
        from fti.nav.integrity.reference import check_alert_limit  # noqa: PLC0415 - as in parse_reference

        check_alert_limit(reference, settings.alert_v_m, settings.profile, config.path)
    return reference


def parse_reference(config: Config, texts: Mapping[str, str]) -> ApproachReference | None:
    """The reference profile of ``nav.approach``, if it can be flown with the rest of it; None without an approach.

    Raises ConfigError.
    """
    settings = config.nav.approach
    if settings is None:
        return None
    # they bring numpy, and recording should begin soon
    from fti.nav.integrity.reference import ApproachReference, check_settings  # noqa: PLC0415

    if "nav.approach.profile" not in texts:  # of a recorded configuration
        raise ConfigError(f"{config.path}: nav.approach.profile = {settings.profile!r}: its text is not attached")
    reference = ApproachReference.parse(texts["nav.approach.profile"], settings.profile)
    check_settings(reference, settings, config.path)
    return reference
