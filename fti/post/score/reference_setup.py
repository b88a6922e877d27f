"""The configuration for the score of a flight: that of the emulator, not that in the recording of the unit.

A recorded configuration that differs in the expected behaviour gives one finding per key: devices, links by name and
kind, ``[nav]``, and the files that they name.  Ports, storage, page and bus may differ.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator, Mapping
from pathlib import PurePath
from typing import Any

from fti.config import Config
from fti.devices import FILE_ENDING, bind_devices
from fti.errors import ConfigError, FtiError
from fti.hil.scenario import Scenario
from fti.hil.truth_log import RATES_ATTACHMENT
from fti.logger.reading.recording import Recording
from fti.logger.session import CONFIG_ATTACHMENT
from fti.post.reprocess import Setup, attached_config, other_setup
from fti.post.score.rows import CONFIGURATION, FlightFinding, Result
from fti.post.score.truth_reader import FlightTruth

NAME = "as the emulator played it"
Table = Mapping[str, Any]


def read_reference_setup(flight_truth: FlightTruth, scenario: Scenario) -> Setup:
    """The configuration of the emulator; the scenario's own where an older truth file has none.

    Raises ConfigError or MissingError.
    """
    if CONFIG_ATTACHMENT not in flight_truth.attached:
        return other_setup(scenario.config)
    files = {name: data for name, data in flight_truth.attached.items() if name != RATES_ATTACHMENT}
    config, texts = attached_config(files, flight_truth.file)
    return Setup(config, texts, bind_devices(config, texts), None)


def scenario_setup(scenario: Scenario, reference_setup: Setup) -> Setup | None:
    """The configuration that the scenario names; None where it is the same, or cannot be loaded here."""
    with contextlib.suppress(FtiError):
        own = other_setup(scenario.config)
        return None if own.config.text == reference_setup.config.text and own.texts == reference_setup.texts else own
    return None


def compare_recorded(reference_setup: Setup, recording: Recording) -> list[FlightFinding]:
    """A finding for each difference of the recorded configuration; one where there is none.  Raises RecordingError."""
    try:
        config, texts = attached_config(recording.attachments(), recording.path)
    except ConfigError as error:
        return [FlightFinding(CONFIGURATION, NAME, Result.FAILS, f"the recorded configuration is invalid: {error}")]
    findings = [FlightFinding(CONFIGURATION, *one) for one in differences(reference_setup, config, texts)]
    return findings or [FlightFinding(CONFIGURATION, NAME, Result.HOLDS, "the recorded configuration is the same")]


def user_setup_finding() -> list[FlightFinding]:
    """The finding where --config replaces the comparison."""
    return [
        FlightFinding(
            CONFIGURATION, NAME, Result.NOT_DUE, "the configuration of --config is used, and was not compared"
        )
    ]


def differences(reference_setup: Setup, config: Config, texts: Mapping[str, str]) -> Iterator[tuple[str, Result, str]]:
    """Key, result and text of each difference; a missing table is one difference."""
    emulated = _flatten(_relevant_settings(reference_setup.config, reference_setup.texts))
    recorded = _flatten(_relevant_settings(config, texts))
    keys = [key for key in sorted(emulated.keys() | recorded.keys()) if emulated.get(key) != recorded.get(key)]
    for key in keys:
        if not any(parent in keys for parent in _parents(key)):
            yield (
                key,
                Result.FAILS,
                f"{key}: {_value_text(recorded.get(key))} is recorded, {_value_text(emulated.get(key))} was played",
            )


def _parents(key: str) -> Iterator[str]:
    while "." in key:
        key = key.rpartition(".")[0]
        yield key


def _relevant_settings(config: Config, texts: Mapping[str, str]) -> dict[str, Any]:
    """The settings on which the expected behaviour of a unit depends."""
    nav = config.nav.model_dump()
    if nav["approach"]:
        nav["approach"]["profile"] = _digest(texts.get("nav.approach.profile"))
    if nav["terrain"]:
        nav["terrain"]["files"] = tuple(PurePath(file).name for file in nav["terrain"]["files"])
    devices = {
        device.name: {**device.model_dump(), "options": _options(f"device[{i}].options", device.options, texts)}
        for i, device in enumerate(config.device)
    }
    return {"device": devices, "link": {link.name: link.kind for link in config.link}, "nav": nav}


def _options(key: str, options: Table, texts: Mapping[str, str]) -> dict[str, Any]:
    """The options of a device; files are compared by content, not by path."""
    return {
        name: _digest(texts.get(f"{key}.{name}")) if name.endswith(FILE_ENDING) else value
        for name, value in options.items()
    }


def _digest(text: str | None) -> str | None:
    return None if text is None else f"SHA-256 {hashlib.sha256(text.encode()).hexdigest()[:16]}"


def _flatten(table: Table, key: str = "") -> dict[str, Any]:
    """Every value by its key path; a table itself has the value "{...}"."""
    flat: dict[str, Any] = {}
    for name, value in table.items():
        path = f"{key}.{name}" if key else name
        if isinstance(value, Mapping):
            flat |= {path: "{...}", **_flatten(value, path)}
        elif value is not None:
            flat[path] = list(value) if isinstance(value, tuple) else value
    return flat


def _value_text(value: Any) -> str:
    return "nothing" if value is None else f"{value!r}"
