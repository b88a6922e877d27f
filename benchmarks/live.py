"""Sensor byte to integrity output on the bus, live, and how fast a flight is reprocessed.

    python benchmarks/live.py [--duration S]

The demonstration's aircraft at its full rates: emulator, recorder, navigation and bus are processes of this machine.
The radar altimeter is predicted with its whole beam (2051 rays) over known terrain, and the filter runs.  A delay
counts from the kernel's stamp of the altimeter's bytes to the arrival of the output at a subscriber of the bus;
repeated outputs without new measurements do not count.  The recorder passes most frames on with its period of 20 ms, so
a delay depends on the phase of the altimeter's clock: here that clock is fast, so that its phase passes through whole
periods.

Reprocessing then processes the same session on one core, in processor time.  The pipeline leads from bytes to outputs:
decoding, stamping, navigation (``Pipeline``).  The whole command also reads and writes files.
"""

from __future__ import annotations

import argparse
import json
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine, percentile
from fti.bus.client import Subscriber
from fti.bus.frame import SOCKET_NAME
from fti.bus.message import decode
from fti.drivers import Decoder
from fti.logger.reading.recording import Recording
from fti.messages.frames import TICK_LINK, RawFrame
from fti.messages.measurements import Measurement
from fti.nav.kernel_warmup import warm_up
from fti.nav.pipeline import Pipeline
from fti.post.reprocess import Setup, infrequent_gc, recorded_setup, reprocess
from fti.service.navigation.decode_chain import Chain

ROOT = Path(__file__).resolve().parent.parent
FTI = [str(Path(sys.executable).with_name("fti"))]
INTEGRITY = "/nav/clearance_integrity"
HEIGHT = "/nav/height_above_ground/altimeter"
#: Delays count from this time after the first output on, when clocks are estimated and code is loaded [s].
SETTLE_S = 10.0
START_S = 120.0
P50_MS, P99_MS, MIN_SPEED = 8.0, 20.0, 20.0
#: Drift of the altimeter's clock, and its time through one period of the recorder [s].
FAST_PPM = 800
BEAT_PASSED_S = 0.02 / (1e-6 * FAST_PPM)


def write_config(folder: Path) -> Path:
    """The demonstration's configuration on free ports, with the whole beam."""
    text = (ROOT / "configs" / "demo.toml").read_text(encoding="utf-8")
    for port in ("47401", "47402"):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            text = text.replace(port, str(free.getsockname()[1]))
    text = text.replace('kind = "radar"', 'kind = "radar"\nmodel = "beam"')
    text = text.replace('"profiles/', f'"{ROOT / "configs" / "profiles"}/') + "\n[display]\nenabled = false\n"
    path = folder / "live.toml"
    path.write_text(text, encoding="utf-8")
    return path


def write_scenario(folder: Path, config: Path) -> Path:
    """The nominal approach of that configuration, with an altimeter whose clock is fast."""
    text = (ROOT / "configs" / "scenarios" / "nominal.toml").read_text(encoding="utf-8")
    path = folder / "passing_beats.toml"
    text = text.replace('"../demo.toml"', f'"{config}"') + f"\n[sensor.altimeter]\ndrift_ppm = {FAST_PPM}\n"
    path.write_text(text, encoding="utf-8")
    return path


class DeviceDecoder:
    """Delays of the outputs of a daemon [ns], by topic."""

    def __init__(self, info: dict[str, Any]) -> None:
        self.delays: dict[str, list[tuple[int, int]]] = {}
        self._epoch_ns = info["epoch_ns"]
        self._last_valid_ns: dict[str, int | None] = {}
        self._lock = threading.Lock()
        self._subscriber = Subscriber(Path(info["sock"]).with_name(SOCKET_NAME), "benchmark", self._on_message)

    def _on_message(self, topic: str, payload: bytes, sent_ns: int) -> None:
        now_ns = time.monotonic_ns() + self._epoch_ns
        if topic not in {INTEGRITY, HEIGHT}:
            return
        fields = decode(topic, payload)
        with self._lock:
            new = fields["t_valid_ns"] != self._last_valid_ns.get(topic) and fields["t_valid_ns"] is not None
            self._last_valid_ns[topic] = fields["t_valid_ns"]
            if new:
                self.delays.setdefault(topic, []).append((now_ns, now_ns - fields["t_ns"]))

    def close(self) -> None:
        """Close the subscription."""
        self._subscriber.close()

    def settled_ms(self, topic: str) -> list[float]:
        """Sorted delays after the start, over whole periods of the recorder [ms]."""
        found = self.delays.get(topic, [])
        if not found:
            return []
        begin, last = found[0][0] + int(SETTLE_S * 1e9), found[-1][0]
        passed = max((last - begin) // int(BEAT_PASSED_S * 1e9), 1)
        end = begin + passed * int(BEAT_PASSED_S * 1e9)
        return sorted(delay / 1e6 for at, delay in found if begin <= at <= end)


def fly(folder: Path, duration_s: float) -> tuple[Path, DeviceDecoder]:
    """Emulator and daemon; returns the session and the delays."""
    config, links, run_dir = write_config(folder), folder / "links", folder / "run"
    arguments = ["--links", str(links), "--wait", "--duration", str(duration_s)]
    with subprocess.Popen(
        [*FTI, "hil", str(write_scenario(folder, config)), *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as hil:
        wait_for(links.is_dir)
        arguments = ["--out", str(folder / "out"), "--links", str(links), "--origin", "hil", "--run-dir", str(run_dir)]
        with subprocess.Popen([*FTI, "run", str(config), *arguments], stdout=subprocess.DEVNULL) as daemon:
            wait_for((run_dir / "fti.json").is_file)
            listener = DeviceDecoder(json.loads((run_dir / "fti.json").read_text()))
            hil.wait()
            listener.close()
            daemon.send_signal(2)
    return next((folder / "out").iterdir()), listener


def wait_for(condition: Any) -> None:
    """Wait for a condition.  Raises TimeoutError."""
    deadline = time.monotonic() + START_S
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError("the daemon or the emulator did not start")
        time.sleep(0.1)


@dataclass(frozen=True, slots=True)
class Cost:
    """Processor time of a session [s], and its duration [s].

    command              : ``fti reprocess``, with the kernels, which are loaded once
    navigation, decoding : parts of the pipeline
    """

    flight_s: float
    command_s: float
    loading_s: float
    reading_s: float
    pipeline_s: float
    decoding_s: float
    navigation_s: float

    def rows(self) -> Iterator[tuple[str, float]]:
        """Parts of the command; parts of a part are indented."""
        yield "loading kernels", self.loading_s
        yield "reading", self.reading_s
        yield "pipeline", self.pipeline_s
        yield "  decoding", self.decoding_s
        yield "  navigation", self.navigation_s
        yield "writing", self.command_s - self.loading_s - self.reading_s - self.pipeline_s


def measure_reprocessing(session: Path, folder: Path) -> Cost:
    """Reprocess, then do each part alone; the rest is writing."""
    recording = Recording.open(session)
    setup = recorded_setup(recording, session)
    ground = setup.load_terrain()
    starting = seconds(lambda: warm_up(setup.config, ground))
    running = seconds(lambda: reprocess(recording, setup, folder, as_flown=False, progress=lambda seq: None))
    reading = seconds(lambda: sum(1 for _ in recording.frames()))
    frames = list(recording.frames())
    chain = setup.make_chain()
    chain.set_terrain(ground, None, 0, frames[0].t_rx_ns)
    return Cost(
        flight_s=(frames[-1].t_rx_ns - frames[0].t_rx_ns) / 1e9,
        command_s=starting + running,
        loading_s=starting,
        reading_s=reading,
        pipeline_s=seconds(lambda: feed_all(chain, frames)),
        decoding_s=seconds(lambda: decode_all(setup, frames)),
        navigation_s=navigation_s(setup, list(decode_events(setup, frames))),
    )


def seconds(run: Callable[[], Any]) -> float:
    """Processor time of a function [s], with the garbage collection of reprocessing."""
    with infrequent_gc():
        begin = time.process_time()
        run()
        return time.process_time() - begin


def feed_all(chain: Chain, frames: list[RawFrame]) -> None:
    """Bytes to outputs."""
    for frame in frames:
        chain.feed(frame)


def decode_all(setup: Setup, frames: list[RawFrame]) -> None:
    """Bytes to measurements only."""
    decoders: dict[str, list[Decoder]] = {}
    for bound in setup.devices:
        decoders.setdefault(bound.device.link, []).append(bound.make_decoder())
    for frame in frames:
        for decoder in decoders.get(frame.link, ()):
            decoder.feed(frame.data, frame.t_rx_ns)


def navigation_s(setup: Setup, events: list[tuple[int, list[tuple[str, Measurement]]]]) -> float:
    """Processor time of navigation alone [s], on the measurements of a session."""
    pipeline = Pipeline(setup.config, setup.reference)
    pipeline.set_terrain(setup.load_terrain())

    def feed() -> None:
        for t_ns, found in events:
            for device, measurement in found:
                pipeline.feed(device, measurement)
            if not found:
                pipeline.tick(t_ns)

    return seconds(feed)


def decode_events(setup: Setup, frames: list[RawFrame]) -> Iterator[tuple[int, list[tuple[str, Measurement]]]]:
    """Ticks (nothing) and measurements in order."""
    chain = setup.make_chain()
    for frame in frames:
        products = chain.feed(frame)
        if frame.link == TICK_LINK or products.measurements:
            yield frame.t_rx_ns, products.measurements


def print_result(cost: Cost) -> None:
    """Print the cost of each part, and its speed over real time."""
    print(f"reprocessing {cost.flight_s:.0f} s, times real time on one core")
    for name, part_s in (("the whole command", cost.command_s), *cost.rows()):
        columns = f"{part_s:6.2f} s  {1e3 * part_s / cost.flight_s:6.1f} ms per s of flight"
        print(f"  {name:<21}{columns}  {100 * part_s / cost.command_s:3.0f} %  {cost.flight_s / part_s:6.1f} x")


def main() -> int:
    """Run the flight, reprocess, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=70.0, help="of the flight [s] (70)")
    args = parser.parse_args()
    print(machine())
    targets = Targets()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        session, listener = fly(folder, args.duration)
        for topic in (HEIGHT, INTEGRITY):
            delays = listener.settled_ms(topic)
            p50, p99 = (percentile(delays, share) for share in (0.5, 0.99))  # type: ignore[arg-type]
            max_ms = delays[-1] if delays else float("nan")
            print(f"{topic}: {len(delays)} new outputs, p50 {p50:.1f} ms, p99 {p99:.1f} ms, longest {max_ms:.1f} ms")
        holds = len(delays) > 50 and p50 <= P50_MS and p99 <= P99_MS
        targets.check(f"bytes to integrity on the bus: p50 <= {P50_MS:g} ms, p99 <= {P99_MS:g} ms", holds)
        cost = measure_reprocessing(session, folder / "again")
        print_result(cost)
    holds = cost.flight_s / cost.pipeline_s >= MIN_SPEED
    targets.check(f"the pipeline >= {MIN_SPEED:g} x real time on one core", holds)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
