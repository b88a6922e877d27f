"""Random courses: alignment in level flight, legs with turns between them, climbs, or continuous turns."""

from __future__ import annotations

import numpy as np

from fti.arrays import Rng
from fti.constants import STANDARD_GRAVITY
from fti.study.faults.trajectory import Course, SmoothProfile

#: Level and straight from the start, so that a filter can align [s].
ALIGNMENT_S = 120.0
SPEED_M_S = (60.0, 110.0)
SPEED_CHANGE_S = 25.0
LEG_S, TURN_LEG_S = (40.0, 180.0), (0.5, 8.0)
BANK_RAD = (np.deg2rad(12.0), np.deg2rad(35.0))
ROLL_S = 5.0
TURN_RAD = (np.deg2rad(30.0), np.deg2rad(210.0))
CLIMB_RAD = (np.deg2rad(1.5), np.deg2rad(5.0))
CLIMB_ROUND_S = 6.0
CRUISE_S = (30.0, 180.0)


def draw_course(
    rng: Rng, place: tuple[float, float], heights: tuple[float, float], turns: tuple[float, float]
) -> Course:
    """One course from a place (lat, lon [rad]), between two heights [m], that turns without legs between two times [s].

    The second of ``turns`` is the end of the flight, the first may be the same.
    """
    speed = rng.uniform(*SPEED_M_S)
    start_alt = rng.uniform(*heights)
    end_s = turns[1]
    return Course(
        speed=_speed(rng, speed, end_s),
        climb=_climb(rng, speed, start_alt, heights, end_s),
        track_rate=_track_rate(rng, speed, turns),
        start=(*place, start_alt),
        track=rng.uniform(-np.pi, np.pi),
        angle_of_attack=rng.uniform(np.deg2rad(1.0), np.deg2rad(5.0)),
        drift_angle=rng.normal(0.0, np.deg2rad(3.0)),
    )


def _speed(rng: Rng, mean: float, end_s: float) -> SmoothProfile:
    times, values = [0.0, ALIGNMENT_S], [mean, mean]
    while times[-1] < end_s:
        begin = times[-1] + rng.uniform(*CRUISE_S)
        times += [begin, begin + SPEED_CHANGE_S]
        values += [values[-1], mean * rng.uniform(0.88, 1.12)]
    return SmoothProfile(times, values)


def _climb(rng: Rng, speed: float, alt: float, heights: tuple[float, float], end_s: float) -> SmoothProfile:
    """Climbs and descents to heights drawn between the limits; each begins and ends with a round-out."""
    times, values = [0.0, ALIGNMENT_S], [0.0, 0.0]
    while times[-1] < end_s:
        target = rng.uniform(*heights)
        angle = np.sign(target - alt) * rng.uniform(*CLIMB_RAD)
        steady = max(1.0, (target - alt) / (speed * np.sin(angle)) - CLIMB_ROUND_S)
        begin = times[-1] + rng.uniform(*CRUISE_S)
        times += [begin, begin + CLIMB_ROUND_S, begin + CLIMB_ROUND_S + steady, begin + 2.0 * CLIMB_ROUND_S + steady]
        values += [0.0, angle, angle, 0.0]
        alt += speed * np.sin(angle) * (steady + CLIMB_ROUND_S)
    return SmoothProfile(times, values)


def _track_rate(rng: Rng, speed: float, turns: tuple[float, float]) -> SmoothProfile:
    """Legs and turns; between the two times of ``turns`` the legs are a few seconds long."""
    times, values = [0.0, ALIGNMENT_S], [0.0, 0.0]
    while times[-1] < turns[1]:
        rate = rng.choice((-1.0, 1.0)) * STANDARD_GRAVITY * np.tan(rng.uniform(*BANK_RAD)) / speed
        steady = max(1.0, rng.uniform(*TURN_RAD) / abs(rate) - ROLL_S)
        begin = times[-1] + rng.uniform(*(TURN_LEG_S if times[-1] >= turns[0] else LEG_S))
        times += [begin, begin + ROLL_S, begin + ROLL_S + steady, begin + 2.0 * ROLL_S + steady]
        values += [0.0, rate, rate, 0.0]
    return SmoothProfile(times, values)
