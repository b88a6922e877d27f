"""Print what the second receiver finds: ``python -m tests.second_receiver heights|approaches``."""

from __future__ import annotations

import argparse
import sys

from tests.second_receiver import approaches, heights
from tests.second_receiver.cases import HEIGHT_CASES


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.second_receiver")
    parser.add_argument("what", choices=("heights", "approaches"))
    parser.add_argument("--sites", type=int, default=6, help="surfaces for each case of heights, 4 flights over each")
    parser.add_argument("--runs", type=int, default=20, help="approaches of each kind")
    parser.add_argument("--reference-runs", type=int, default=400, help="simulated approaches of a reference")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="cases whose name contains this")
    parser.add_argument(
        "--verbose", action="store_true", help="reasons of samples that are not valid, errors by height"
    )
    args = parser.parse_args()
    print(f"seed {args.seed}")
    return _heights(args) if args.what == "heights" else _approaches(args)


def _heights(args: argparse.Namespace) -> int:
    print(heights.TITLE)
    for case in HEIGHT_CASES:
        if args.only not in str(case):
            continue
        flights = heights.run_sites(case, args.sites, args.seed)
        for line in heights.lines(case, flights):
            print(line, flush=True)
        if args.verbose:
            for line in heights.details(flights):
                print(line, flush=True)
    return 0


def _approaches(args: argparse.Namespace) -> int:
    for kind in approaches.GROUNDS:
        if args.only not in kind:
            continue
        site = approaches.make_site(kind, args.seed, args.reference_runs)
        outcomes = [approaches.fly_nominal(site, number, args.seed) for number in range(args.runs)]
        print(approaches.line_of_nominal(kind, outcomes), flush=True)
        flights = [approaches.fly_over_obstacle(site, number, args.seed) for number in range(args.runs)]
        print(approaches.line_of_obstacles(kind, flights), flush=True)
        if args.verbose:
            for outcome in outcomes:
                print(f"    nominal  {outcome}")
            for obstacle, outcome in flights:
                print(f"    obstacle at {obstacle.s:.0f} m  {outcome}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
