"""Falsifications of the attached configuration: it promises less, or allows more, than that of the scenario."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from fti.logger.reading.mcap_file import McapMessage
from tests.post.score.sabotage.falsification import Falsification, Sample, Target
from tests.post.score.sabotage.message_edits import Forgery

NAME, PROFILE = "config.toml", "nav.approach.profile"
Config = dict[str, Any]


def as_toml(value: Any) -> str:
    """A value as TOML; tables inline."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {as_toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    return json.dumps(value)


def _edit(forgery: Forgery, change: Callable[[Config], None]) -> None:
    def changed(text: str) -> str:
        config = tomllib.loads(text)
        before = tomllib.loads(text)
        change(config)
        return text if config == before else "\n".join(f"{key} = {as_toml(value)}" for key, value in config.items())

    forgery.edit_attachment(NAME, changed)


def config_of(sample: Sample) -> Config:
    """The attached configuration."""
    return tomllib.loads(sample.session.files["raw"][0].attachments[NAME].decode())


def _remove_topics(forgery: Forgery, *prefixes: str) -> None:
    """Delete the messages of these topics."""
    topics = [topic for topic in forgery.session.topics("derived") if topic.startswith(prefixes)]
    forgery.edit("derived", topics, lambda item: list[McapMessage]())


def _remove_nav(forgery: Forgery) -> None:
    _edit(forgery, lambda config: config.pop("nav", None))
    _remove_topics(forgery, "/nav/")


def _nav_key(name: str) -> Callable[[Forgery], None]:
    """A part of navigation is not configured any more."""
    return lambda forgery: _edit(forgery, lambda config: config["nav"].pop(name, None))


def _without_navigation(sample: Sample) -> Iterator[Target]:
    nav = config_of(sample).get("nav")
    if nav:
        yield Target("with its outputs", _remove_nav)
        yield Target("outputs kept", lambda forgery: _edit(forgery, lambda config: config.pop("nav")))
        for name in nav:
            if name not in ("position", "attitude", "altimeters"):
                yield Target(f"nav.{name}", _nav_key(name))


def _without_role(sample: Sample) -> Iterator[Target]:
    """A device has no role any more, so that nothing is expected of it."""
    nav = config_of(sample).get("nav", {})
    for role in ("position", "attitude", "altimeters"):
        for name in nav.get(role, []):
            yield Target(f"{role} of {name}", _drop_role(role, name))


def _drop_role(role: str, name: str) -> Callable[[Forgery], None]:
    return lambda forgery: _edit(forgery, lambda config: config["nav"][role].remove(name))


def _without_device(sample: Sample) -> Iterator[Target]:
    for device in config_of(sample).get("device", []):
        yield Target(device["name"], _drop_device(device["name"]))


def _drop_device(name: str) -> Callable[[Forgery], None]:
    def change(config: Config) -> None:
        config["device"] = [device for device in config["device"] if device["name"] != name]
        nav = config.get("nav", {})
        for role in ("position", "attitude", "altimeters"):
            if name in nav.get(role, []):
                nav[role].remove(name)

    def apply(forgery: Forgery) -> None:
        _edit(forgery, change)
        _remove_topics(forgery, f"/{name}/", f"/nav/height_above_ground/{name}")

    return apply


def _of_devices(key: str, change: Callable[[Any], Any]) -> Callable[[Sample], Iterator[Target]]:
    """A key of each device that has it, in turn."""

    def targets(sample: Sample) -> Iterator[Target]:
        for number, device in enumerate(config_of(sample).get("device", [])):
            if key in device:
                yield Target(device["name"], _device_edit(number, key, change))

    return targets


def _device_edit(number: int, key: str, change: Callable[[Any], Any]) -> Callable[[Forgery], None]:
    def edit(config: Config) -> None:
        config["device"][number][key] = change(config["device"][number][key])

    return lambda forgery: _edit(forgery, edit)


def _of_approach(key: str, value: object) -> Callable[[Sample], Iterator[Target]]:
    def targets(sample: Sample) -> Iterator[Target]:
        if "approach" in config_of(sample).get("nav", {}):
            yield Target(
                "", lambda forgery: _edit(forgery, lambda config: config["nav"]["approach"].update({key: value}))
            )

    return targets


def _other_profile(sample: Sample) -> Iterator[Target]:
    """The profile of the approach, 50 m higher."""
    if PROFILE in sample.session.files["raw"][0].attachments:
        yield Target("", lambda forgery: forgery.edit_attachment(PROFILE, _raise_profile))


def _raise_profile(text: str) -> str:
    rows = text.splitlines()
    return "\n".join(_raise_row(row) for row in rows) + "\n"


def _raise_row(row: str) -> str:
    cells = row.split(",")
    try:
        cells[1] = f"{float(cells[1]) + 50.0:.3f}"
    except (ValueError, IndexError):
        return row
    return ",".join(cells)


def _shorter_range(altimeter: Config) -> Config:
    return {**altimeter, "range_m": [altimeter["range_m"][0], 30.0]}


WHY = "the session must be of the configuration that the scenario names; only ports and places may be others"
CONFIGURATIONS: Sequence[Falsification] = (
    Falsification("configuration without navigation, or a part of it", WHY, _without_navigation),
    Falsification("configuration without a role of a device", WHY, _without_role),
    Falsification("configuration without a device", WHY, _without_device),
    Falsification("configuration with 20 times the age", WHY, _of_devices("max_age_ms", lambda age: 20 * age)),
    Falsification("configuration with half the rate", WHY, _of_devices("rate_hz", lambda rate: rate / 2)),
    Falsification("configuration with a latency of 500 ms", WHY, _of_devices("latency_ms", lambda _: 500)),
    Falsification("configuration with a shorter range", WHY, _of_devices("altimeter", _shorter_range)),
    Falsification("configuration with another alert limit", WHY, _of_approach("alert_v_m", 500.0)),
    Falsification("configuration with another profile", WHY, _other_profile),
)
