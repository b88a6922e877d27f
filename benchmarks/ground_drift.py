"""Processor time of the drift over the ground: decoding, looks and registration, as a share of a core.

    python benchmarks/ground_drift.py [--rounds N] [--duration S]

First alone: a flight of 20 s over a valley of the demo scene, 50 to 90 m above it, with the images of
``configs/scan_drift.toml`` (75 x 75 pixels, 2 Hz), and one with the packets of a Velodyne VLP-16 at full rate in their
place (754 a second).  The recorded bytes are then decoded and navigated again, with ``[nav.scan_drift]`` and without it
and the frames of its device.  The difference is what the drift costs, the states of the filter included.  "tick" is the
longest time of one tick of navigation, which delays its outputs.  Processor times of one thread, with the kernels
compiled.

Then live, beside everything else of the research aircraft: the emulator flies it past a real daemon, without a range
sensor and with each one in turn, in rounds.  The difference of the processor times of recorder and navigation is that
of the sensor: reading, recording, decoding, looks, registration.  That of navigation is over the time of the flight
that it has processed, which a growing backlog makes shorter.  The two line scanners are those of
``configs/scan_drift_pair.toml``, 10,000 points/s each.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts import research_flight
from benchmarks.parts.machine import Targets, machine
from benchmarks.parts.research_flight import Round
from fti import config as configuration
from fti.config import Config
from fti.devices import bind_devices
from fti.hil.tables.schema import Scenario
from fti.logger.reading.recording import Recording
from fti.messages.frames import RawFrame
from fti.messages.outputs import GroundDrift
from fti.nav.kernel_warmup import warm_up
from fti.post import offline_run
from fti.service.navigation.decode_chain import Chain

SECONDS, MAX_SHARE = 20.0, 0.25
#: Largest age of the newest frame that navigation has processed [s].
MAX_LAG_S = 0.5
CONFIGS = Path(__file__).resolve().parents[1] / "configs"
FILE, PAIR_FILE = CONFIGS / "scan_drift.toml", CONFIGS / "scan_drift_pair.toml"
IMAGER = 'driver = "binary_struct"'
SCANNER = 'driver = "velodyne_vlp16"\nrate_hz = 754\nlatency_ms = 1.4\nrpy_bs_deg = [-90.0, 0.0, 90.0]\n'


def scanner_text(text: str) -> str:
    """The configuration with a VLP-16 in place of the imager."""
    begin, end = text.index(IMAGER), text.index('[[device]]\nname = "ins"')
    text = text[:begin] + SCANNER + "max_age_ms = 500\n\n" + text[end:]
    return text.replace("range_sd_m = 0.05", "range_sd_m = 0.03\nexposure_s = 0.2")


def load(text: str, folder: Path) -> Config:
    """A configuration of this text."""
    file = folder / "scan_drift.toml"
    file.write_text(text)
    return configuration.load(file)


def make_scenario() -> Scenario:
    """Straight on, at one altitude."""
    points = [(36.6262, -84.1228), (36.6200, -84.1600)]
    flight = {
        "kind": "waypoints",
        "waypoint": tuple({"lat_deg": lat, "lon_deg": lon, "alt_m": 415.0, "speed_mps": 60.0} for lat, lon in points),
    }
    return Scenario.model_validate({"title": "t", "description": "", "config": "none", "flight": flight})


def run(config: Config, frames: Sequence[RawFrame]) -> tuple[float, float, list[GroundDrift]]:
    """Processor time of all frames and of the longest tick [s]; the drifts."""
    chain, drifts, longest = Chain(config, bind_devices(config), None), [], 0.0
    begin = time.process_time()
    for frame in frames:
        before = time.process_time()
        products = chain.feed(frame)
        longest = max(longest, time.process_time() - before)
        drifts += [each for each in products.outputs if isinstance(each, GroundDrift)]
    return time.process_time() - begin, longest, drifts


def measure(name: str, text: str, targets: Targets) -> None:
    """One line for a sensor."""
    with TemporaryDirectory() as folder:
        config = load(text, Path(folder))
        warm_up(config, None)
        session = offline_run.fly(config, make_scenario(), Path(folder), until_s=SECONDS)
        frames = list(Recording.open(session).frames())
    without = config.model_copy(update={"nav": config.nav.model_copy(update={"scan_drift": None})})
    others = [frame for frame in frames if frame.link != "imager_eth"]
    best = min((run(config, frames) for _ in range(2)), key=lambda result: result[0])
    rest = min((run(without, others) for _ in range(2)), key=lambda result: result[0])
    share = (best[0] - rest[0]) / SECONDS
    pairs = {each.t_valid_ns: each for each in best[2] if each.pairs}
    found = sum(bool(each.directions) for each in pairs.values())
    print(
        f"{name:24} {100 * share:5.1f} % of a core beside {100 * rest[0] / SECONDS:4.1f} %; {len(pairs)} pairs, "
        f"{found} with a drift; tick {1e3 * best[1]:.0f} ms, without {1e3 * rest[1]:.0f} ms"
    )
    targets.check(f"{name}: at most {100 * MAX_SHARE:.0f} % of a core", share <= MAX_SHARE)


def _part(text: str, begin: str, end: str) -> str:
    """The text from the table that begin names to the one that end names."""
    first = text.index(begin)
    return text[first : text.index(end, first)]


def _device(name: str) -> str:
    return f'[[device]]\nname = "{name}"\n'


def _link(name: str) -> str:
    return f'[[link]]\nname = "{name}"\n'


def looks_text(text: str, first: str = "imager") -> str:
    """Links, devices and looks of a configuration whose range sensors begin with the first one."""
    links = _part(text, _link(f"{first}_eth"), _link("ins_eth")) + "buffer_bytes = 8388608\n"
    return links + _part(text, _device(first), _device("ins")) + _part(text, "[nav.scan_drift]", "[nav.alert_limits]")


def live_sensors() -> dict[str, tuple[tuple[str, ...], str]]:
    """Name -> links of the range sensors, and their part of the configuration."""
    text, pair = FILE.read_text(encoding="utf-8"), PAIR_FILE.read_text(encoding="utf-8")
    return {
        "without": ((), ""),
        "imager": (("imager_eth",), looks_text(text)),
        "2 lines": (("front_eth", "rear_eth"), looks_text(pair, "front")),
        "VLP-16": (("imager_eth",), looks_text(scanner_text(text))),
    }


def measure_live(rounds: int, duration_s: float, targets: Targets) -> None:
    """Fly each configuration in each round; print and judge."""
    base, sensors = research_flight.research_text(), live_sensors()
    flown = {name: list[Round]() for name in sensors}
    print(f"live, beside the research aircraft: {rounds} rounds of {duration_s:g} s")
    for _ in range(rounds):
        for name, (links, text) in sensors.items():
            flown[name].append(research_flight.fly(base + text, links, duration_s))
    print("         recorder  navigation     lag  output delay [ms]     emulator late [ms]     datagrams")
    print("         % of core  % of core  max ms   p50   p99   max        p50      p99       sent  recorded   pairs")
    for name, results in flown.items():
        print(_row(name, results))
    for name, results in flown.items():
        _judge(name, results, flown["without"], targets)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def _row(name: str, results: Sequence[Round]) -> str:
    cpu = [100 * _mean([each.cpu[process] for each in results]) for process in research_flight.PROCESSES]
    delays = [delay for each in results for delay in each.delay_ms]
    p50, p99 = (sorted(column)[len(column) // 2] for column in list(zip(*delays, strict=True))[:2])
    longest, lag = max(delay[2] for delay in delays), max(lag for each in results for lag in each.lag_ms)
    row = f"{name:8} {cpu[0]:9.1f} {cpu[1]:10.1f} {lag:7.0f} {p50:5.1f} {p99:5.1f} {longest:5.1f}"
    if name == "without":
        return row
    late = [max(each.late_ms[i] for each in results) for i in (0, 1)]
    sent, recorded = sum(each.sent for each in results), sum(each.recorded for each in results)
    pairs, found = sum(each.pairs for each in results), sum(each.found for each in results)
    return f"{row} {late[0]:10.2f} {late[1]:8.2f} {sent:10d} {recorded:9d} {found:4d}/{pairs}"


def _judge(name: str, results: Sequence[Round], without: Sequence[Round], targets: Targets) -> None:
    dropped = sum(each.dropped for each in results)
    is_whole = not dropped and all(each.verified and each.sent == each.recorded for each in results)
    targets.check(f"{name}: {dropped} frames dropped, every datagram recorded, fti verify holds", is_whole)
    lag_s = 1e-3 * max(lag for each in results for lag in each.lag_ms)
    targets.check(f"{name}: navigation keeps up, at most {MAX_LAG_S:g} s late", lag_s <= MAX_LAG_S)
    if name != "without":
        shares = [one.total - other.total for one, other in zip(results, without, strict=True)]
        text = f"{name}: {100 * _mean(shares):.1f} % of a core ({100 * min(shares):.1f} to {100 * max(shares):.1f})"
        targets.check(f"{text}, at most {100 * MAX_SHARE:.0f} %", _mean(shares) <= MAX_SHARE)


def main() -> int:
    """Both sensors alone, then live."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3, help="of the live flights; 0: none (default: 3)")
    parser.add_argument("--duration", type=float, default=40.0, metavar="S", help="of a live flight (default: 40 s)")
    args = parser.parse_args()
    print(machine())
    targets, text = Targets(), FILE.read_text(encoding="utf-8")
    measure("imager 75 x 75, 2 Hz", text, targets)
    measure("VLP-16, 754 packets/s", scanner_text(text), targets)
    if args.rounds:
        measure_live(args.rounds, args.duration, targets)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
