"""The configuration: one TOML file, strict, read once and frozen.

Links say what is plugged in, devices what is understood, roles (``[nav]``) what is used for what.
Relative paths are relative to the file.  An error names the file, the key path, the value and what is allowed.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from fti.errors import ConfigError, MissingError

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
Positive = Annotated[float, Field(gt=0)]
Vector = tuple[float, float, float]


class StrictModel(BaseModel):
    """A frozen table in which unknown keys and wrong types are errors.  Driver options derive from it too."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


# ------------------------------------------------------------------------------------------------------- session


class Session(StrictModel):
    """``[session]``: where the recording goes and how it is cut.

    fallback : on another medium; the recording goes on there while ``directory`` refuses
    """

    name: Name
    directory: str = "data"
    fallback: str | None = None
    split_s: Positive = 300.0
    split_mb: Positive = 1024.0
    min_free_mb: Annotated[float, Field(ge=0)] = 500.0
    origin: Literal["flight", "hil", "replay"] = "flight"
    mode: Literal["continuous", "snapshot"] = "continuous"  # snapshot: frames are recorded around a trigger only


class Snapshot(StrictModel):
    """``[snapshot]``: the last ``before_s`` seconds are kept in memory, and on a trigger written into a file.

    max_mb : the memory is never larger [MiB]; the oldest frames go first
    """

    before_s: Annotated[float, Field(gt=0, le=86_400)] = 120.0
    after_s: Annotated[float, Field(ge=0, le=86_400)] = 10.0
    max_mb: Annotated[float, Field(ge=1, le=65_536)] = 256.0


class RecorderTuning(StrictModel):
    """``[recorder]``: how the machine treats the recorder's process.  All off by default.

    cpu         : it runs on these processors only; none : on all
    scheduler   : fifo : before every ordinary process; its reader with ``priority``, its other threads one below
    lock_memory : none of its memory is ever swapped out
    freeze_gc   : Python's collector of cycles stands still
    """

    cpu: tuple[Annotated[int, Field(ge=0)], ...] = ()
    scheduler: Literal["other", "fifo"] = "other"
    priority: Annotated[int, Field(ge=2, le=49)] = 20  # the kernel's own interrupt threads have 50
    lock_memory: bool = False
    freeze_gc: bool = False


# --------------------------------------------------------------------------------------------------------- links


class Buffered(StrictModel):
    """What every link has: a name, permission to send, and the size of each of its three buffers."""

    name: Name
    transmit: bool = False
    buffer_bytes: Annotated[int, Field(ge=4096, le=2**30)] = 2**19


class SerialLink(Buffered):
    """A tty or pty; RS-232, RS-422 or RS-485 behind an adapter."""

    kind: Literal["serial"]
    port: str
    baud: Annotated[int, Field(gt=0)] = 115200
    data_bits: Literal[5, 6, 7, 8] = 8
    parity: Literal["none", "even", "odd", "mark", "space"] = "none"
    stop_bits: Literal[1, 2] = 1
    flow: Literal["none", "rtscts", "xonxoff"] = "none"


Endpoint = Annotated[str, Field(pattern=r"^(\d{1,3}(\.\d{1,3}){3}|\[[0-9a-fA-F:]+\]):\d{1,5}$")]


class UdpLink(Buffered):
    """Datagrams to ``bind`` (address:port), only from ``source`` when given; ``group`` joins a multicast group."""

    kind: Literal["udp"]
    bind: Endpoint
    source: str | None = None
    group: str | None = None
    peer: Endpoint | None = None  # where transmitted datagrams go


class CanLink(Buffered):
    """A CAN bus: any python-can interface; ``slcan`` on a serial port is parsed directly."""

    kind: Literal["can"]
    interface: str
    channel: str
    bitrate: Annotated[int, Field(gt=0)] | None = None
    fd: bool = False
    settings: dict[str, Any] = Field(default_factory=dict)  # further python-can arguments, as they are


Link = Annotated[SerialLink | UdpLink | CanLink, Field(discriminator="kind")]


# ------------------------------------------------------------------------------------------------------- devices


class Altimeter(StrictModel):
    """``[device.altimeter]``: the limits inside which an altimeter is believed."""

    kind: Literal["radar", "laser"]
    range_m: tuple[float, float]
    max_roll_deg: Positive = 30.0
    max_pitch_deg: Positive = 30.0
    beam_deg: Positive = 40.0  # full width of the beam
    sd_m: Positive | None = None  # one sigma, when the device does not say


class Device(StrictModel):
    """``[[device]]``: what is understood; any number on one link."""

    name: Name
    link: Name
    driver: str
    rate_hz: Positive | None = None
    max_age_ms: Positive = 1000.0
    latency_ms: Annotated[float, Field(ge=0)] = 0.0
    use_device_time: bool = True  # once its clock is known against FTI time; false: validity from the arrival alone
    lever_arm_b: Vector = (0.0, 0.0, 0.0)  # reference point P to sensor, body frame [m]
    rpy_bs_deg: Vector = (0.0, 0.0, 0.0)  # mounting: roll, pitch, yaw that turn the sensor frame into the body frame
    altimeter: Altimeter | None = None
    options: dict[str, Any] = Field(default_factory=dict)


# --------------------------------------------------------------------------------------------- navigation, display


class TerrainFiles(StrictModel):
    """``[nav] terrain``: elevation files and the datum of their heights."""

    files: tuple[str, ...]
    vertical: Literal["ellipsoid", "egm96"]


class Approach(StrictModel):
    """``[nav.approach]``: the published approach and the limits of its integrity monitor."""

    profile: str
    window_m: Positive = 400.0
    y_max_m: Positive = 150.0
    max_roll_deg: Positive = 10.0
    max_pitch_deg: Positive = 10.0
    alert_s_m: Positive = 50.0
    alert_y_m: Positive = 100.0
    alert_v_m: Positive = 5.0
    alert_v_deg: Positive = 0.35


class Nav(StrictModel):
    """``[nav]``: roles, each a list of devices in order of preference."""

    attitude: tuple[Name, ...] = ()
    position: tuple[Name, ...] = ()
    altimeters: tuple[Name, ...] = ()
    terrain: TerrainFiles | None = None
    approach: Approach | None = None


class Display(StrictModel):
    """``[display]``: the page; on loopback only."""

    enabled: bool = True
    address: Literal["127.0.0.1"] = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8080


class Bus(StrictModel):
    """``[bus]``: outputs and health on zenoh, at an explicit endpoint on loopback; port 0 takes a free one."""

    enabled: bool = True
    port: Annotated[int, Field(ge=0, le=65535)] = 0


class Config(StrictModel):
    """The whole configuration.  ``text`` is the file as it was read; ``path`` where from."""

    session: Session
    link: tuple[Link, ...] = ()
    device: tuple[Device, ...] = ()
    nav: Nav = Nav()
    display: Display = Display()
    bus: Bus = Bus()
    snapshot: Snapshot | None = None
    recorder: RecorderTuning = RecorderTuning()
    path: str = ""
    text: str = ""

    def devices_on(self, link: str) -> tuple[Device, ...]:
        """The devices that listen to a link."""
        return tuple(d for d in self.device if d.link == link)

    def find_device(self, name: str) -> Device | None:
        """The device of that name."""
        return next((d for d in self.device if d.name == name), None)


# ------------------------------------------------------------------------------------------------------- reading

Model = TypeVar("Model", bound=StrictModel)


def bind(model: type[Model], table: Mapping[str, Any], file: str, key: str = "") -> Model:
    """Make a model of a TOML table.  Raises ConfigError with file, key path, value and what is allowed."""
    try:
        return model.model_validate(_lists_to_tuples(table))
    except ValidationError as error:
        raise ConfigError("; ".join(_sentences(error, model, file, key))) from None


def _lists_to_tuples(value: Any) -> Any:
    """TOML has arrays where the models have tuples."""
    if isinstance(value, Mapping):
        return {k: _lists_to_tuples(v) for k, v in value.items()}
    if isinstance(value, list):
        return tuple(_lists_to_tuples(v) for v in value)
    return value


def _sentences(error: ValidationError, model: type[BaseModel], file: str, key: str) -> Iterable[str]:
    for item in error.errors():
        where = _key_path(key, item["loc"])
        if item["type"] == "extra_forbidden":
            known = ", ".join(sorted(_known_keys(model, item["loc"][:-1])))
            yield f"{file}: {where}: there is no such key; allowed here: {known or 'none'}"
        elif item["type"] == "missing":
            yield f"{file}: {where}: missing; it must be given"
        else:
            yield f"{file}: {where} = {_shown(item['input'])}: {item['msg'][0].lower()}{item['msg'][1:]}"


def _key_path(key: str, loc: tuple[int | str, ...]) -> str:
    path = key
    for part in loc:
        if part in ("serial", "udp", "can") and path.endswith("]"):
            continue  # the discriminator of a link is not a key of the file
        path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else part
    return path


def _known_keys(model: type[BaseModel], loc: tuple[int | str, ...]) -> set[str]:
    """The keys of the model at a place inside another one, found through its JSON schema."""
    schema = _json_schema(model)
    node = _resolve(schema, schema)
    for part in loc:
        node = _resolve(schema, _step(node, part, schema))
    return set(node.get("properties", {})) - {"path", "text"}


@cache
def _json_schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


def _step(node: dict[str, Any], part: int | str, schema: dict[str, Any]) -> dict[str, Any]:
    if isinstance(part, int):
        items: dict[str, Any] = node.get("items", {})
        return items
    mapping = node.get("discriminator", {}).get("mapping", {})
    if part in mapping:
        return {"$ref": mapping[part]}
    found: dict[str, Any] = node.get("properties", {}).get(part, {})
    return next((o for o in found.get("anyOf", ()) if "$ref" in o), found)


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    ref = node.get("$ref")
    if ref is None:
        return node
    target: dict[str, Any] = schema["$defs"][ref.rsplit("/", 1)[1]]
    return target


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def read_toml(path: Path) -> tuple[dict[str, Any], str]:
    """A TOML file as a table, and its text.  Raises MissingError or ConfigError."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise MissingError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is not UTF-8 text") from None
    try:
        return tomllib.loads(text), text
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: is not valid TOML: {error}") from None


def load(path: str | Path) -> Config:
    """Read, check and freeze a configuration.  Raises ConfigError or MissingError."""
    file = Path(path)
    table, text = read_toml(file)
    return parse(table, text, file)


def parse(table: Mapping[str, Any], text: str, file: Path) -> Config:
    """The configuration in a TOML table; file : where it stands (for messages and relative paths)."""
    for reserved in ("path", "text"):
        if reserved in table:
            raise ConfigError(f"{file}: {reserved}: there is no such key")
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
    for i, device in enumerate(config.device):
        if device.link not in links:
            raise ConfigError(f"{file}: device[{i}].link = {device.link!r}: no such link; there are {_listed(links)}")
        if device.altimeter and not device.altimeter.range_m[0] < device.altimeter.range_m[1]:
            shown = list(device.altimeter.range_m)
            raise ConfigError(f"{file}: device[{i}].altimeter.range_m = {shown}: the first must be below the second")
    for role in ("attitude", "position", "altimeters"):
        for name in getattr(config.nav, role):
            if name not in devices:
                raise ConfigError(f"{file}: nav.{role}: {name!r} is no device; there are {_listed(devices)}")
    for device in config.device:
        if device.name in config.nav.altimeters and device.altimeter is None:
            raise ConfigError(f"{file}: nav.altimeters: device {device.name!r} needs a [device.altimeter] table")


def _check_unique(names: list[str], file: str, kind: str) -> None:
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ConfigError(f"{file}: {kind}[{i}].name = {name!r}: used twice; names must differ")


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


def _resolve_paths(config: Config, folder: Path) -> Config:
    def absolute(text: str) -> str:
        return os.path.abspath(folder / text)  # noqa: PTH100 - without "..", and without following links

    nav = config.nav
    if nav.terrain:
        files = tuple(absolute(f) for f in nav.terrain.files)
        nav = nav.model_copy(update={"terrain": nav.terrain.model_copy(update={"files": files})})
    if nav.approach:
        approach = nav.approach.model_copy(update={"profile": absolute(nav.approach.profile)})
        nav = nav.model_copy(update={"approach": approach})
    session = config.session.model_copy(update={"directory": absolute(config.session.directory)})
    if session.fallback is not None:
        session = session.model_copy(update={"fallback": absolute(session.fallback)})
        if session.fallback == session.directory:
            shown = config.session.fallback
            raise ConfigError(f"{config.path}: session.fallback = {shown!r}: must not be session.directory itself")
    return config.model_copy(update={"nav": nav, "session": session})


def with_links(config: Config, folder: str | Path) -> Config:
    """The same configuration with every serial and slcan port at ``folder/<link>``, where an emulator puts them."""

    def moved(link: SerialLink | UdpLink | CanLink) -> SerialLink | UdpLink | CanLink:
        place = str(Path(folder).absolute() / link.name)
        if isinstance(link, SerialLink):
            return link.model_copy(update={"port": place})
        if isinstance(link, CanLink) and link.interface == "slcan":
            return link.model_copy(update={"channel": place})
        return link

    return config.model_copy(update={"link": tuple(moved(link) for link in config.link)})


def with_session(config: Config, **changes: Any) -> Config:
    """The same configuration with keys of ``[session]`` replaced (``directory``, ``origin``)."""
    return config.model_copy(update={"session": config.session.model_copy(update=changes)})
