"""Processor time of the drift over the ground: decoding, looks and registration, as a share of a core.

    python benchmarks/ground_drift.py

A flight of 20 s over a valley of the demo scene, 50 to 90 m above it, with the images of ``configs/scan_drift.toml``
(75 x 75 pixels, 2 Hz), and one with the packets of a Velodyne VLP-16 at full rate in their place (754 a second).  The
recorded bytes are then decoded and navigated again, with ``[nav.scan_drift]`` and without it and the frames of its
device.  The difference is what the drift costs, the states of the filter included.  "tick" is the longest time of one
tick of navigation, which delays its outputs.  Processor times of one thread, with the kernels compiled.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
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
FILE = Path(__file__).resolve().parents[1] / "configs" / "scan_drift.toml"
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


def main() -> int:
    """Both sensors."""
    print(machine())
    targets, text = Targets(), FILE.read_text(encoding="utf-8")
    measure("imager 75 x 75, 2 Hz", text, targets)
    measure("VLP-16, 754 packets/s", scanner_text(text), targets)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
