"""Check a configuration or a scenario, and print a summary of it.

Configuration (a file with [session], [[link]] ...): checks every key, the drivers' options and the named files; prints
links, devices, roles and sinks, one per line, and how long storage may stall before a link loses its first byte.  Use
it before fti run.

Scenario (a file with title, config, [flight] ..., or the name of a shipped one: fti hil --list): checks everything
that fti hil would reject, without flying it or opening a port; prints flight, devices, each fault with its expected
flags and their limits, and the [[expect]] rows.  It takes a few seconds.  Use it before fti hil.

  fti check configs/research_aircraft.toml
  fti check configs/bench.toml --json
  fti check configs/bench.toml --live
  fti check nominal
  fti check my_scenario.toml --config my_aircraft.toml

With --live it also listens for five seconds on every link of a configuration and prints the state of each link; it
sends nothing, and the exit code is 1 when a link is not good.

The stall is a lower bound: it assumes a full serial line or CAN bus, and datagrams of maximum size.
Missing roles, warnings (probable mistakes) and hints (settings of this computer) do not fail the check; the outputs of
a missing role are invalid, with the printed reason.  docs/reference explains every key of a configuration and of a
scenario, fti hil --faults every kind of fault.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fti.cli._printing import print_json, print_line, print_lines
from fti.constants import SECOND_NS
from fti.messages.frames import TICK_PERIOD_NS
from fti.messages.reasons import Reason

if TYPE_CHECKING:
    from fti.cli._checked_file import CheckedFile
    from fti.config import CanLink, Config, Device, Nav, SerialLink, UdpLink

LIVE_DURATION_S = 5.0
EXIT_DOES_NOT_HOLD = 1
#: Used where the devices of a link have no configured rate.
ASSUMED_RATE_HZ = 100.0
#: Reads in which one message of a serial line arrives, in the mean (Spiegel 2018, eq. 6.2, c_msg).
SERIAL_RECEPTIONS = 2.0
#: The largest payload of a datagram that Ethernet carries in one piece [B].
DATAGRAM_BYTES = 1472.0
#: A CAN frame with 8 bytes of data and the interframe space [bit], without stuff bits.
CAN_FRAME_BITS = 111
MAX_CAN_BITRATE = 1_000_000

#: Reason of the outputs when a role has no device.
ROLES = {"attitude": Reason.NO_ATTITUDE, "position": Reason.NO_POSITION, "altimeters": Reason.NO_ALTIMETER}


@dataclass(frozen=True, slots=True)
class LinkLoad:
    """Maximum load of a link: messages per second, their length [B], reads in which one arrives."""

    rate_hz: float
    message_bytes: float
    receptions: float
    words: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti check``."""
    parser.add_argument(
        "file", metavar="FILE", help="a configuration or a scenario (TOML), or the name of a shipped scenario"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--live", action="store_true", help="listen on every link for five seconds")
    parser.add_argument("--links", metavar="DIR", help="open every serial and slcan port at DIR/<link> (an emulator)")
    parser.add_argument("--config", metavar="CONFIG", help="for a scenario: replaces its configuration")


def run(args: argparse.Namespace) -> int:
    """Check and print.  Raises FtiError with one sentence for the first mistake."""
    from fti.cli._checked_file import read_file

    file = read_file(args.file)
    return _check_scenario(file, args) if file.is_scenario else _check_config(file, args)


def _check_config(file: CheckedFile, args: argparse.Namespace) -> int:
    from fti import config as configuration
    from fti.cli._check_view import lines
    from fti.cli._progress import show_progress

    if args.config:
        args.parser.error(f"--config: only with a scenario; {args.file} is a configuration")
    config = configuration.parse(file.table, file.text, file.path)
    if args.links:
        config = configuration.with_links(config, args.links)
    with show_progress("checking"):
        found = describe(config)
    if args.live:
        found["live"] = _listen(config)
    print_json(found, indent=2) if args.json else print_lines(lines(found))
    return 0 if all(link["state"] == "good" for link in found.get("live", {}).values()) else EXIT_DOES_NOT_HOLD


def _check_scenario(file: CheckedFile, args: argparse.Namespace) -> int:
    from pathlib import Path

    from fti.cli._compile_notice import announce_compilation
    from fti.cli._emulator_run import print_notice
    from fti.cli._progress import show_progress
    from fti.cli._scenario_view import describe, lines
    from fti.hil import scenario as scenarios
    from fti.hil.oracle.scenario_check import check_scenario

    for option in ("live", "links"):
        if getattr(args, option):
            args.parser.error(f"--{option}: only with a configuration; {args.file} is a scenario")
    scenario = scenarios.parse(file.table, file.text, file.path)
    config = scenarios.load_config(scenario, Path(args.config) if args.config else None)
    with announce_compilation(), show_progress("checking"):
        found = describe(check_scenario(scenario, config, print_notice))
    print_json(found, indent=2) if args.json else print_lines(lines(found))
    return 0


def _listen(config: Config) -> dict[str, dict[str, Any]]:
    import asyncio

    from fti.devices import bind_devices
    from fti.service.link_probe import probe_links

    print_line(f"listening for {LIVE_DURATION_S:g} s ...", error=True)
    return asyncio.run(probe_links(config, bind_devices(config), LIVE_DURATION_S))


# --------------------------------------------------------------------------------------------------------- checking


def describe(config: Config) -> dict[str, Any]:
    """Summary of a configuration, ready for JSON.  Raises ConfigError or MissingError."""
    from fti.cli._check_sinks import describe_sinks, sink_warnings
    from fti.cli._config_warnings import warnings
    from fti.cli._receive_buffer import hints
    from fti.cli._terrain_files import describe_layers, describe_terrain
    from fti.config import error_lines
    from fti.devices import bind_devices
    from fti.service.supervisor.startup_checks import ValidatedConfig

    ValidatedConfig(config, epoch_ns=0)  # rejects everything that fti run would reject
    session, devices = config.session, bind_devices(config)
    with error_lines(config.path, config.text):
        terrain, layers = list(describe_terrain(config)), list(describe_layers(config))
    return {
        "config": config.path,
        "session": session.model_dump(include={"name", "directory", "split_s", "split_mb", "min_free_mb", "mode"}),
        "storage": _describe_storage(config),
        "snapshot": _describe_snapshot(config),
        "links": [_describe_link(link, config.devices_on(link.name)) for link in config.link],
        "devices": [
            {
                **bound.device.model_dump(
                    include={"name", "link", "driver", "rate_hz", "max_age_ms", "use_device_time"}
                ),
                "document": bound.driver.DOCUMENT,
            }
            for bound in devices
        ],
        "roles": {role: list(getattr(config.nav, role)) for role in ROLES},
        "filter": _filter(config.nav),
        "terrain_position": _terrain_position(config),
        "scan_drift": _scan_drift(config.nav),
        "terrain": terrain,
        "terrain_layers": layers,
        "land_cover": _land_cover(config.nav),
        "approach": config.nav.approach.profile if config.nav.approach else None,
        "sinks": describe_sinks(config),
        "missing": list(describe_missing(config)),
        "warnings": [
            *_shared_ports(config),
            *_poor_storage(config),
            *warnings(config, devices, layers),
            *sink_warnings(config),
        ],
        "hints": list(hints(config)),
    }


def _filter(nav: Nav) -> str | None:
    """The inertial unit of the filter and the devices that aid it; None without a filter."""
    if nav.filter is None:
        return None
    single = (name for name in (nav.filter.airspeed, nav.filter.heading) if name is not None)
    aids = dict.fromkeys((*nav.filter.gnss, *nav.filter.baro, *nav.filter.altimeters, *single))
    return f"{nav.filter.imu}, aided by {', '.join(aids) or 'nothing'}"


def _terrain_position(config: Config) -> str | None:
    """The altimeter whose profiles give positions, and their duration; None without them."""
    from fti.config import is_multibeam

    settings = config.nav.terrain_position
    if settings is None:
        return None
    device = config.find_device(settings.altimeter)
    beams = " with all beams" if device and is_multibeam(device) else ""
    return f"profiles of {settings.altimeter}{beams}, {settings.window_s:g} s each, aid the filter"


def _scan_drift(nav: Nav) -> str | None:
    """The device whose looks give the drift, and their times; None without them."""
    settings = nav.scan_drift
    if settings is None:
        return None
    looks = f"looks of {settings.exposure_s:g} s" if settings.exposure_s else "images"
    of_pair = f"{looks} of {settings.device} that overlap by half"
    if settings.second_device is not None:
        of_pair = f"strips of {settings.exposure_s:g} s, of {settings.device} and later of {settings.second_device},"
    return f"{of_pair} aid the filter after they have agreed with satellites"


def _land_cover(nav: Nav) -> dict[str, Any] | None:
    """The raster of classes, and what altimeters measure over them; None without one."""
    if nav.terrain is None or nav.terrain.land_cover is None:
        return None
    return {"file": nav.terrain.land_cover, "cover": [table.model_dump() for table in nav.terrain.cover]}


def _describe_storage(config: Config) -> list[dict[str, Any]]:
    """The storage targets, the main one first, with their free space."""
    from pathlib import Path

    from fti.errors import StorageError
    from fti.logger.storage_target import find_mount_point, free_mb

    plan = []
    for role, directory in (("main", config.session.directory), ("fallback", config.session.fallback)):
        if directory is None:
            continue
        existing = next(path for path in (Path(directory), *Path(directory).parents) if path.exists())
        free: float | None = None
        fault = ""
        try:
            free = free_mb(existing)
        except StorageError as error:
            fault = str(error)
        medium = str(find_mount_point(Path(directory)))
        plan.append({"role": role, "directory": directory, "medium": medium, "free_mb": free, "fault": fault})
    return plan


def _poor_storage(config: Config) -> Iterator[str]:
    """Warnings on storage targets; they may be fixed before the daemon starts."""
    plan = _describe_storage(config)
    for place in plan:
        if place["free_mb"] is not None and place["free_mb"] < config.session.min_free_mb:
            yield (
                f"{place['directory']}: {place['free_mb']:.0f} MB are free, less than session.min_free_mb = "
                f"{config.session.min_free_mb:g}: the outputs of navigation are not written there, and raw bytes only "
                "without a fallback; delete old sessions"
            )
    if len({place["medium"] for place in plan}) < len(plan):
        yield f"session.fallback is on the same medium as session.directory ({plan[0]['medium']})"


def _describe_snapshot(config: Config) -> dict[str, float] | None:
    """Settings of the snapshot, and the time that fits into its memory when every link is at its full rate."""
    from fti.logger.storage_target import MEGABYTE
    from fti.service.recorder.snapshot.frame_memory import HEAD_BYTES

    if config.snapshot is None:
        return None
    loads = [worst_load(link, config.devices_on(link.name)) for link in config.link]
    rate = sum(load.rate_hz * (load.message_bytes + load.receptions * HEAD_BYTES) for load in loads)
    holds = config.snapshot.max_mb * MEGABYTE / (rate + HEAD_BYTES * SECOND_NS / TICK_PERIOD_NS)
    return {**config.snapshot.model_dump(), "holds_s": round(holds, 1)}


def describe_missing(config: Config) -> Iterator[dict[str, str]]:
    """Roles without a device, and the reason of their outputs."""
    from fti.devices import check_reference, read_texts
    from fti.nav.integrity.approach_channel import idle_reason

    for role, reason in ROLES.items():
        if not getattr(config.nav, role):
            yield {"role": role, "reason": reason.value}
    if config.nav.approach is None:
        yield {"role": "approach", "reason": Reason.NO_PROFILE.value}
    elif config.nav.altimeters:
        reference = check_reference(config, read_texts(config))
        unfit = None if reference is None else idle_reason(config, reference)  # no altimeter matches the reference
        if unfit:
            yield {"role": "approach", "reason": unfit.value}


def _shared_ports(config: Config) -> Iterator[str]:
    """Links with the same port; the second would find it busy."""
    owners: dict[str, str] = {}
    for link in config.link:
        port = port_of(link)
        if port in owners:
            yield f"links {owners[port]} and {link.name} use the same port {port}"
        owners[port] = link.name


def _describe_link(link: SerialLink | UdpLink | CanLink, devices: Sequence[Device]) -> dict[str, Any]:
    from fti.buffers.triple_buffer import TripleBuffer

    load = worst_load(link, devices)
    stall = TripleBuffer(link.buffer_bytes).capacity_s(load.rate_hz, load.message_bytes, load.receptions)
    return {
        "name": link.name,
        "kind": link.kind,
        "port": port_of(link),
        "transmit": link.transmit,
        "devices": [d.name for d in devices],
        "stall_s": round(stall, 1),
        "stall_at": load.words,
    }


def port_of(link: SerialLink | UdpLink | CanLink) -> str:
    """The port of a link, in one word."""
    if link.kind == "serial":
        return link.port
    return link.bind if link.kind == "udp" else f"{link.interface}:{link.channel}"


def worst_load(link: SerialLink | UdpLink | CanLink, devices: Sequence[Device]) -> LinkLoad:
    """The maximum load of a link at the rates of its devices."""
    rate = sum(d.rate_hz or 0.0 for d in devices) or ASSUMED_RATE_HZ
    if link.kind == "serial":
        bits = 1 + link.data_bits + (link.parity != "none") + link.stop_bits
        return LinkLoad(rate, link.baud / bits / rate, SERIAL_RECEPTIONS, f"a full line of {link.baud} baud")
    if link.kind == "udp":
        return LinkLoad(rate, DATAGRAM_BYTES, 1.0, f"{rate:g} datagrams/s of {DATAGRAM_BYTES:g} B")
    bitrate = link.bitrate or MAX_CAN_BITRATE
    size = 72.0 if link.fd else 16.0
    return LinkLoad(bitrate / CAN_FRAME_BITS, size, 1.0, f"a full bus of {bitrate / 1000:g} kbit/s")
