"""Sensor byte to integrity output on the bus, live, and how fast a flight is reprocessed.

    python benchmarks/live.py [--duration S]

The demonstration's aircraft at its full rates: emulator, recorder, navigation and bus are processes of this machine.
The radar altimeter is expected with its whole beam (2051 rays) over known terrain, and the filter runs.  A delay counts
from the kernel's stamp of the altimeter's bytes to the arrival of the output at a subscriber of the bus; what is
repeated because nothing new was said does not count.  Reprocessing then takes the same session: by one core, the
seconds are the processor's; the whole command, and what of it is loading the kernels, reading, decoding, navigation
(``Pipeline``) and the rest.
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
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Verdict, machine, percentile
from fti.bus.message import decode
from fti.bus.zenoh_bus import Subscriber
from fti.drivers import Decoder
from fti.logger.reading.recording import Recording
from fti.nav.pipeline import Pipeline
from fti.nav.warm import warm_up
from fti.post.reprocess import Setup, recorded_setup, reprocess
from fti.types import TICK_LINK, Measurement, RawFrame

ROOT = Path(__file__).resolve().parent.parent
FTI = [str(Path(sys.executable).with_name("fti"))]
INTEGRITY = "/nav/clearance_integrity"
HEIGHT = "/nav/height_above_ground/altimeter"
#: Not before this time after the first output: clocks are learned and code is loaded [s].
SETTLE_S = 10.0
START_S = 120.0
P50_MS, P99_MS, LEAST_SPEED = 20.0, 50.0, 20.0


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


class Listener:
    """Delays of the outputs of a daemon [ns], by topic."""

    def __init__(self, info: dict[str, Any]) -> None:
        self.delays: dict[str, list[tuple[int, int]]] = {}
        self._epoch_ns = info["epoch_ns"]
        self._seen: dict[str, int | None] = {}
        self._lock = threading.Lock()
        self._subscriber = Subscriber.connect(info["zenoh"], info["name"], self._hear)

    def _hear(self, topic: str, payload: bytes) -> None:
        now_ns = time.monotonic_ns() + self._epoch_ns
        fields = decode(payload) if topic in {INTEGRITY, HEIGHT} else None
        if fields is None:
            return
        with self._lock:
            new = fields["t_valid_ns"] != self._seen.get(topic) and fields["t_valid_ns"] is not None
            self._seen[topic] = fields["t_valid_ns"]
            if new:
                self.delays.setdefault(topic, []).append((now_ns, now_ns - fields["t_ns"]))

    def close(self) -> None:
        """Listen no longer."""
        self._subscriber.close()

    def settled_ms(self, topic: str) -> list[float]:
        """Delays after the start, in order of size [ms]."""
        found = self.delays.get(topic, [])
        begin = found[0][0] + int(SETTLE_S * 1e9) if found else 0
        return sorted(delay / 1e6 for at, delay in found if at >= begin)


def fly(folder: Path, duration_s: float) -> tuple[Path, Listener]:
    """Emulator and daemon; returns the session and what was heard."""
    config, links, run_dir = write_config(folder), folder / "links", folder / "run"
    common = ["--config", str(config), "--links", str(links), "--wait", "--duration", str(duration_s)]
    with subprocess.Popen(
        [*FTI, "hil", "nominal", *common], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as hil:
        wait_for(links.is_dir)
        arguments = ["--out", str(folder / "out"), "--links", str(links), "--origin", "hil", "--run-dir", str(run_dir)]
        with subprocess.Popen([*FTI, "run", str(config), *arguments], stdout=subprocess.DEVNULL) as daemon:
            wait_for((run_dir / "fti.json").is_file)
            listener = Listener(json.loads((run_dir / "fti.json").read_text()))
            hil.wait()
            listener.close()
            daemon.send_signal(2)
    return next((folder / "out").iterdir()), listener


def wait_for(condition: Any) -> None:
    """Until it is so.  Raises TimeoutError."""
    deadline = time.monotonic() + START_S
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError("the daemon or the emulator did not start")
        time.sleep(0.1)


def reprocessed(session: Path, folder: Path) -> tuple[float, dict[str, float]]:
    """Seconds of the flight, and of the processor for ``fti reprocess`` and for its parts alone.

    What is not counted by itself, stamps, queues and the derived file, is what is left of the whole.
    """
    recording = Recording.open(session)
    setup = recorded_setup(recording, session)
    ground = setup.load_ground()
    starting = seconds(lambda: warm_up(setup.config, ground))
    running = seconds(lambda: reprocess(recording, setup, folder, as_flown=False, progress=lambda seq: None))
    reading = seconds(lambda: sum(1 for _ in recording.frames()))
    frames = list(recording.frames())
    parts = {
        "loading kernels": starting,
        "reading": reading,
        "decoding": seconds(lambda: decode_all(setup, frames)),
        "navigation": navigation_s(setup, list(measured(setup, frames))),
    }
    flown_s = (frames[-1].t_rx_ns - frames[0].t_rx_ns) / 1e9
    return flown_s, {**parts, "stamping and writing": starting + running - sum(parts.values())}


def seconds(run: Callable[[], Any]) -> float:
    """Seconds of the processor that it takes."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def decode_all(setup: Setup, frames: list[RawFrame]) -> None:
    """Bytes to measurements, and nothing else."""
    decoders: dict[str, list[Decoder]] = {}
    for bound in setup.devices:
        decoders.setdefault(bound.device.link, []).append(bound.make_decoder())
    for frame in frames:
        for decoder in decoders.get(frame.link, ()):
            decoder.feed(frame.data, frame.t_rx_ns)


def navigation_s(setup: Setup, events: list[tuple[int, list[tuple[str, Measurement]]]]) -> float:
    """Seconds of the processor for navigation alone, of the measurements of a session."""
    pipeline = Pipeline(setup.config, setup.reference)
    pipeline.give_ground(setup.load_ground())
    begin = time.process_time()
    for t_ns, found in events:
        for device, measurement in found:
            pipeline.feed(device, measurement)
        if not found:
            pipeline.tick(t_ns)
    return time.process_time() - begin


def measured(setup: Setup, frames: list[RawFrame]) -> Iterator[tuple[int, list[tuple[str, Measurement]]]]:
    """Ticks (nothing) and measurements in order."""
    chain = setup.make_chain()
    for frame in frames:
        products = chain.feed(frame)
        if frame.link == TICK_LINK or products.measurements:
            yield frame.t_rx_ns, products.measurements


def tell(flown_s: float, parts: dict[str, float]) -> tuple[float, float]:
    """Print what each part costs; returns how many times real time the whole and navigation alone are."""
    whole = sum(parts.values())
    print(f"reprocessing {flown_s:.0f} s takes {whole:.2f} s of one core: {flown_s / whole:.1f} x real time")
    for name, part in parts.items():
        told = f"{part:6.2f} s  {1e3 * part / flown_s:6.1f} ms per s of flight"
        print(f"  {name:<21}{told}  {100 * part / whole:3.0f} %  alone {flown_s / part:6.1f} x")
    return flown_s / whole, flown_s / parts["navigation"]


def main() -> int:
    """Fly, reprocess, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=70.0, help="of the flight [s] (70)")
    args = parser.parse_args()
    print(machine())
    verdict = Verdict()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        session, listener = fly(folder, args.duration)
        for topic in (HEIGHT, INTEGRITY):
            delays = listener.settled_ms(topic)
            p50, p99 = (percentile(delays, share) for share in (0.5, 0.99))  # type: ignore[arg-type]
            most = delays[-1] if delays else float("nan")
            print(f"{topic}: {len(delays)} new outputs, p50 {p50:.1f} ms, p99 {p99:.1f} ms, longest {most:.1f} ms")
        holds = len(delays) > 50 and p50 <= P50_MS and p99 <= P99_MS
        verdict.judge(f"bytes to integrity on the bus: p50 <= {P50_MS:g} ms, p99 <= {P99_MS:g} ms", holds)
        whole, alone = tell(*reprocessed(session, folder / "again"))
    verdict.judge(f"navigation >= {LEAST_SPEED:g} x real time on one core", alone >= LEAST_SPEED)
    verdict.judge(f"all of reprocessing >= {LEAST_SPEED:g} x real time on one core", whole >= LEAST_SPEED)
    return verdict.code


if __name__ == "__main__":
    sys.exit(main())
