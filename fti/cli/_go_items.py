"""The items of ``fti preflight``, from the configuration and the live state of its daemon."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fti.cli.check import describe_missing
from fti.config import Config
from fti.constants import SECOND_NS
from fti.logger.storage_target import MEGABYTE
from fti.messages.frames import LinkState
from fti.messages.health import DeviceHealth, HealthRecord
from fti.messages.reasons import Reason
from fti.messages.tables import from_table
from fti.nav.device_time.clock_estimator import ClockState
from fti.service.children import ProcessState

HOUR_S = 3600.0

State = Mapping[str, Any]
#: States of a link whose devices have nothing to decode.
WITHOUT_BYTES = frozenset({LinkState.ABSENT, LinkState.DENIED, LinkState.BUSY, LinkState.SILENT})
#: Reasons of a height whose altimeter does not send; others are normal on the ground.
MISSING_SAMPLES = frozenset({Reason.SILENT, Reason.STALE})


@dataclass(frozen=True, slots=True)
class GoItem:
    """One item.  text : what is measured, or what is wrong"""

    name: str
    is_go: bool
    text: str


def go_items(config: Config, state: State, hours: float) -> Iterator[GoItem]:
    """All items, in the order of a check list.  state : see ``LiveState``; hours : of disk that are needed"""
    health = from_table(HealthRecord, state["health"])
    yield _recording(health)
    yield _disk(config, health, hours)
    yield from _links(config, health)
    yield from _devices(config, health)
    is_starting = health.processes["navigation"].state == ProcessState.STARTING
    yield _navigation(health)
    yield from ([] if is_starting else _roles(config, state["outputs"]))
    yield from _ground(config, health)
    yield _alarms(state["alarms"])


def _recording(health: HealthRecord) -> GoItem:
    session = health.session
    expected = "waiting" if session.mode == "snapshot" else "recording"
    return GoItem("recording", session.state in (expected, "recording"), f"{session.state}: {session.folder}")


def _disk(config: Config, health: HealthRecord, hours: float) -> GoItem:
    """Hours until the free space falls to ``min_free_mb``, at the mean write rate of the recording."""
    if not isinstance(free_mb := health.storage.free_mb, float):
        return GoItem("disk", False, "free space is unknown")
    written = sum(file.stat().st_size for file in Path(health.session.folder).glob("*") if file.is_file())
    elapsed_s = max(health.t_ns - health.session.started_ns, SECOND_NS) / SECOND_NS
    if free_mb < (minimum_mb := config.session.min_free_mb):
        return GoItem("disk", False, f"{free_mb:.0f} MB free, less than session.min_free_mb = {minimum_mb:g}")
    left_h = (free_mb - minimum_mb) * MEGABYTE / max(written, 1) * elapsed_s / HOUR_S
    return GoItem(
        "disk", left_h >= hours, f"{left_h:.0f} h left at {written / elapsed_s / 1000:.0f} kB/s; {hours:g} h needed"
    )


def _links(config: Config, health: HealthRecord) -> Iterator[GoItem]:
    for link in config.link:
        found = health.links.get(link.name)
        if found is None:
            yield GoItem(f"link {link.name}", False, "the daemon has no such link: it runs another configuration")
        else:
            yield GoItem(f"link {link.name}", found.state == LinkState.GOOD, found.hint or found.state)


def _devices(config: Config, health: HealthRecord) -> Iterator[GoItem]:
    for device in config.device:
        if (found := health.devices.get(device.name)) is not None:
            link = health.links.get(device.link)
            if link is not None and link.state in WITHOUT_BYTES:
                yield GoItem(f"device {device.name}", False, f"link {device.link} is {link.state}")
                continue
            problem = _problem_of_device(found, uses_time=device.use_device_time)
            clocks = ", ".join(f"{clock.scale} clock {clock.state}" for clock in found.clocks)
            yield GoItem(f"device {device.name}", not problem, problem or f"{found.rate_hz:.1f} Hz {clocks}".rstrip())


def _problem_of_device(found: DeviceHealth, *, uses_time: bool) -> str:
    if found.state != LinkState.GOOD:
        return found.hint or found.state
    unknown = [clock for clock in found.clocks if uses_time and clock.state != ClockState.GOOD]
    return "; ".join(f"{clock.scale} clock: {clock.state}" for clock in unknown)


def _navigation(health: HealthRecord) -> GoItem:
    """Its process: until it runs, it has no outputs."""
    state = health.processes["navigation"].state
    text = "being compiled or loaded; wait" if state == ProcessState.STARTING else state
    return GoItem("navigation", state == ProcessState.RUNNING, text)


def _roles(config: Config, outputs: State) -> Iterator[GoItem]:
    navigation = outputs.get("/nav/nav_solution", {"late": True})
    for role, prefix in (("position", ""), ("attitude", "attitude_")):
        if not getattr(config.nav, role):
            continue
        if is_go := bool(navigation.get(f"{prefix}valid")) and not navigation["late"]:
            text = f"from {navigation[f'{role}_source']}"
        else:
            reasons = ", ".join(navigation.get(f"{prefix}reasons_text", ())) or "late"
            text = f"{reasons}; none is valid of {', '.join(getattr(config.nav, role))}"
        yield GoItem(role, is_go, text)
    for name in config.nav.altimeters:
        height = outputs.get(f"/nav/height_above_ground/{name}")
        is_go = height is not None and not height["late"] and not MISSING_SAMPLES.intersection(height["reasons"])
        yield GoItem(f"altimeter {name}", is_go, "no heights" if height is None else _describe_height(height))


def _describe_height(height: State) -> str:
    reasons = list(height["reasons_text"])
    if height["late"]:
        reasons.append(f"late, the last value is {height['age_ms'] / 1000.0:.1f} s old")
        return f"no valid height: {', '.join(reasons)}"
    return ", ".join(reasons) or "valid height"


def _ground(config: Config, health: HealthRecord) -> Iterator[GoItem]:
    if config.nav.terrain:
        text, is_loading = str(health.navigation.terrain or "not loaded"), bool(health.navigation.is_terrain_loading)
        wait = "; wait (on a new computer its code is compiled first)" if is_loading else ""
        yield GoItem("terrain", bool(health.navigation.terrain) and not is_loading, f"{text}{wait}")
    if config.nav.approach:
        missing = [each["reason"] for each in describe_missing(config) if each["role"] == "approach"]
        yield GoItem("approach reference", not missing, missing[0] if missing else config.nav.approach.profile)


def _alarms(alarms: list[dict[str, Any]]) -> GoItem:
    lasting = [alarm["title"] for alarm in alarms if alarm["end_ns"] is None or not alarm["is_acknowledged"]]
    return GoItem("alarms", not lasting, ", ".join(lasting) or "none")
