"""Count refusals of sound receivers: ``python -m tests.nav.false_refusals HOURS SEED [--k SIGMAS] [--receiver NAME]``.

Flights of one hour each, receivers in turn; the tests are those of the product.  With a lower ``--k`` the tests can be
counted, and continued with Q(k).
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

import numpy as np

from fti.config import Config, parse
from fti.messages.measurements import Position, Velocity
from fti.nav.plausibility import axis, budget, motion
from fti.nav.plausibility.source import SourceTests, UnstatedSigmas
from tests.nav.healthy_receivers import RECEIVERS, Receiver, fly, measure

HOUR_S = 3600


def config() -> Config:
    table = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": "gnss", "link": "l", "driver": "d"}],
        "nav": {"position": ["gnss"]},
    }
    return parse(table, "", Path("t.toml"))


def refusals(receiver: Receiver, seconds: int, seed: int) -> list[str]:
    """Texts of all refusals in one flight of a sound receiver."""
    rng = np.random.default_rng(seed)
    settings = config()
    tests = SourceTests(settings.device[0], settings.nav.limits, UnstatedSigmas(3.3, 6.6))
    texts: list[str] = []
    for t_ns, m in measure(rng, fly(rng, seconds), receiver):
        if isinstance(m, Position):
            texts += [event.text for event in tests.feed_position(m, t_ns)[1] if event.level == "warning"]
        elif isinstance(m, Velocity):
            texts += [event.text for event in tests.feed_velocity(m, t_ns)[1] if event.level == "warning"]
    return texts


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.nav.false_refusals")
    parser.add_argument("hours", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--k", type=float, help="sigmas of jump and drift in place of the product's")
    parser.add_argument("--receiver", default="", help="receivers whose name contains this")
    args = parser.parse_args()
    if args.k:
        for module in (axis, motion):
            vars(module).update(K_FALSE=args.k, K_JUMP=args.k)
    kinds = [receiver for receiver in RECEIVERS if args.receiver in receiver.name]
    counts: Counter[str] = Counter()
    began = time.monotonic()
    for hour in range(args.hours):
        receiver = kinds[hour % len(kinds)]
        for text in refusals(receiver, HOUR_S, args.seed * 100_000 + hour):
            counts[f"{receiver.name}: {' '.join(text.split()[:3])}"] += 1
            print(f"hour {hour} {receiver.name}: {text}", flush=True)
    for what, count in sorted(counts.items()):
        print(f"{count:4d}  {what}")
    print(
        f"{counts.total()} refusals in {args.hours} h; k {args.k or budget.K_FALSE}; {time.monotonic() - began:.0f} s"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
