"""Processor time of the live position from the ground with a multi-beam altimeter.

    python benchmarks/beams.py [--seconds N]

A flight over hills with posts of 10 m, satellites for 40 s and none after that, profiles of 20 s.  The altimeter sends
frames at 10 Hz, every second one is a sample of the profile.  One thread, processor times:

    decode      frames to ranges, by the driver
    collect     ranges with the navigated state of their time; marks of the position
    match       the fix of a profile, searched to 150 m, as while the position is certain
    search      the same profile searched to 5 km, the farthest
"""

from __future__ import annotations

import argparse
import functools
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
from fti.drivers import multibeam_altimeter as driver
from fti.messages.measurements import BeamRange, DeviceStatus, Stamp, TimeScale
from fti.messages.outputs import Event, TerrainFix
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.match_task import MatchTask
from fti.nav.terrain_matching.fix import MatchFix
from fti.nav.terrain_methods import BeamSearch
from fti.nav.terrain_positioning import MAX_REACH_M
from fti.nav.terrain_reference import Ground
from fti.ranging.multibeam import beams_across
from fti.study.ground_flights import GroundCase, Satellites, Sensors, fly
from fti.study.long_endurance.beams import BeamPosition
from fti.terrain.dem_error import DemError

BEAMS, FRAME_S, WINDOW_S, OUTAGE_FROM_S = (1, 5, 9), 0.1, 20.0, 40.0
SEED, NUMBER, FRAMES = 5, 3, 2000
MAX_SHARE = 0.02


class TimedSearch(BeamSearch):
    """The matching of the live position, timed.  seconds : of each fix [s];  last : profile"""

    def __init__(self) -> None:
        self.seconds: list[float] = []
        self.last: MatchTask | None = None

    def match(self, task: MatchTask) -> MatchFix:
        begin = time.process_time()
        found = super().match(task)
        self.seconds.append(time.process_time() - begin)
        self.last = task
        return found


class TimedPosition(BeamPosition):
    """The live position, timed.  seconds : of all inputs and ticks, matching included [s]"""

    def __init__(self, number: int, case: GroundCase, sensors: Sensors, known: Ground, aided: AidedNavigation) -> None:
        super().__init__(number, case, sensors, known, aided)
        self.seconds, self.search = 0.0, TimedSearch()
        self.position._method = self.search

    def feed(self, k: int) -> None:
        begin = time.process_time()
        super().feed(k)
        self.seconds += time.process_time() - begin

    def tick(self, t_ns: int) -> list[TerrainFix | Event]:
        begin = time.process_time()
        outputs = self.position.tick(t_ns)
        self.seconds += time.process_time() - begin
        return outputs


def decode_s(number: int) -> float:
    """Time of the decoder for a frame [s]."""
    encoder, decoder = driver.make_encoder(driver.Options()), driver.make_decoder(driver.Options())
    frames = []
    for k in range(FRAMES):
        stamp = Stamp(k, k, TimeScale.BOOT)
        for along, across in beams_across(number):
            encoder.encode(BeamRange(stamp=stamp, beam="", along=along, across=across, slant_range=300.0))
        frames += encoder.encode(DeviceStatus(stamp=stamp, ok=True))
    begin = time.process_time()
    for k, frame in enumerate(frames):
        decoder.feed(frame, k)
    return (time.process_time() - begin) / FRAMES


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=300.0)
    seconds = parser.parse_args().seconds
    case = GroundCase(
        seconds=seconds,
        satellites=(Satellites(OUTAGE_FROM_S, seconds, None),),
        window_s=WINDOW_S,
        map_sd=1.0,
        dem_error=DemError(noise_sd=1.5),
        height_s=FRAME_S,
    )
    fly(replace(case, seconds=60.0), SEED, NUMBER, functools.partial(BeamPosition, 9))  # compiled
    print(machine())
    print(f"{seconds:g} s of flight, frames at {1 / FRAME_S:g} Hz, profiles of {WINDOW_S:g} s, one thread")
    print("beams  fixes  decode  collect  match/fix  share of a core  search/fix  error, median")
    targets = Targets()
    for number in BEAMS:
        flown: list[TimedPosition] = []

        def make(*flight: object, number: int = number, flown: list[TimedPosition] = flown) -> TimedPosition:
            flown.append(TimedPosition(number, *flight))  # type: ignore[arg-type]
            return flown[-1]

        run = fly(case, SEED, NUMBER, make)
        position, decode = flown[0], decode_s(number) / FRAME_S
        search, fixes = position.search, [each for each in run.fixes if each.fix.valid]
        assert search.last is not None
        begin = time.process_time()
        BeamSearch().match(replace(search.last, reach_m=MAX_REACH_M))
        far = time.process_time() - begin
        collect = (position.seconds - sum(search.seconds)) / seconds
        share = decode + position.seconds / seconds
        error = float(np.median([np.hypot(*each.error) for each in fixes]))
        print(
            f"{number:5} {len(fixes):6} {decode:7.2%} {collect:8.2%} {np.mean(search.seconds):8.3f} s {share:16.2%} "
            f"{far:9.3f} s {error:12.2f} m",
            flush=True,
        )
    targets.check(f"{number} beams: {share:.2%} of a core; at most {MAX_SHARE:.0%}", share <= MAX_SHARE)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
