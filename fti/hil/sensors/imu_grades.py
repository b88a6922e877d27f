"""Grades of inertial measurement units, with the values of their data sheets.

    navigation  Honeywell HG9900, brochure N61-1638-000-000: gyro bias 0.0035 deg/h, random walk 0.002 deg/sqrt(h),
                scale 5 ppm; accelerometer bias 25 ug, scale 100 ppm, all one sigma
    tactical    Honeywell HG1700, brochure N61-1619-000-001: gyro bias 1 deg/h, random walk 0.125 deg/sqrt(h);
                accelerometer bias 1 mg, random walk 0.065 ft/s/sqrt(h); counts of 2^-33 rad and 2^-27 ft/s at 100 Hz
    mems        Analog Devices ADIS16460, data sheet rev. B, table 1: everything except the walk of the bias

The values of both brochures are quoted from the ImuModel of the NavToolkit (IS4S); the counts are those of NovAtel's
receivers.  Values without source are marked as assumed: in-run bias, scale, alignment and range where a brochure has
none, and the walk of the bias, which reaches the in-run floor after a day.  A repeatability stated as a limit (1 % of
scale) is taken as one sigma.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Literal

from fti.config.keys import NO_UNIT, key
from fti.constants import FOOT, STANDARD_GRAVITY
from fti.hil.sensors.imu import Grade, TriadSpec
from fti.hil.sensors.sensor_settings import DeviceSettings

GradeName = Literal["navigation", "tactical", "mems"]

DEG = math.radians(1.0)
DEG_H = DEG / 3600.0
DEG_ROOT_H = DEG / 60.0
PER_ROOT_H = 1.0 / 60.0
MILLI_G, MICRO_G, PPM = 1e-3 * STANDARD_GRAVITY, 1e-6 * STANDARD_GRAVITY, 1e-6
DAY_S = 86_400.0
#: Standstill of every unit before the flight [s]: assumed.
STANDSTILL_S = 60.0


def bias_random_walk(in_run: float) -> float:
    """Random walk of the bias whose Allan deviation, K sqrt(tau / 3), is in_run at a day [unit / sqrt(s)]: assumed."""
    return in_run * math.sqrt(3.0 / DAY_S)


GRADES: dict[GradeName, Grade] = {
    "navigation": Grade(
        accel=TriadSpec(
            turn_on=25.0 * MICRO_G,
            in_run=5.0 * MICRO_G,  # assumed
            white=0.003 * PER_ROOT_H,  # assumed: 5 ug/sqrt(Hz)
            walk=bias_random_walk(5.0 * MICRO_G),
            scale=100.0 * PPM,
            misalignment=20e-6,  # assumed, both
            skew=10e-6,
            resolution=1e-7,  # assumed, both
            limit=40.0 * STANDARD_GRAVITY,
        ),
        gyro=TriadSpec(
            turn_on=0.0035 * DEG_H,
            in_run=0.003 * DEG_H,  # assumed
            white=0.002 * DEG_ROOT_H,
            walk=bias_random_walk(0.003 * DEG_H),
            scale=5.0 * PPM,
            misalignment=20e-6,  # assumed, both
            skew=10e-6,
            resolution=1e-9,  # assumed, both
            limit=500.0 * DEG,
        ),
    ),
    "tactical": Grade(
        accel=TriadSpec(
            turn_on=1.0 * MILLI_G,
            in_run=0.1 * MILLI_G,  # assumed
            white=0.065 * FOOT * PER_ROOT_H,
            walk=bias_random_walk(0.1 * MILLI_G),
            scale=300.0 * PPM,  # assumed
            misalignment=0.5e-3,  # assumed, both
            skew=0.1e-3,
            resolution=100.0 * 2.0**-27 * FOOT,
            limit=50.0 * STANDARD_GRAVITY,  # assumed
        ),
        gyro=TriadSpec(
            turn_on=1.0 * DEG_H,
            in_run=0.5 * DEG_H,  # assumed
            white=0.125 * DEG_ROOT_H,
            walk=bias_random_walk(0.5 * DEG_H),
            scale=150.0 * PPM,  # assumed
            misalignment=0.5e-3,  # assumed, both
            skew=0.1e-3,
            resolution=100.0 * 2.0**-33,
            limit=1000.0 * DEG,  # assumed
        ),
    ),
    "mems": Grade(
        accel=TriadSpec(
            turn_on=15.0 * MILLI_G,
            in_run=0.2 * MILLI_G,
            white=0.09 * PER_ROOT_H,
            walk=bias_random_walk(0.2 * MILLI_G),
            scale=0.01,
            misalignment=1.0 * DEG,
            skew=0.05 * DEG,
            resolution=0.25 * MILLI_G,
            limit=5.0 * STANDARD_GRAVITY,
        ),
        gyro=TriadSpec(
            turn_on=0.5 * DEG,
            in_run=8.0 * DEG_H,
            white=0.17 * DEG_ROOT_H,
            walk=bias_random_walk(8.0 * DEG_H),
            scale=0.01,
            misalignment=1.0 * DEG,
            skew=0.05 * DEG,
            resolution=0.005 * DEG,
            limit=100.0 * DEG,
        ),
    ),
}


class ImuSettings(DeviceSettings):
    """Inertial sensors of an autopilot or a heading reference."""

    grade: Annotated[GradeName, key("grade of the inertial sensors", NO_UNIT)] = "mems"


def calibrate_gyros(grade: Grade) -> Grade:
    """The grade after gyro calibration at standstill: the remaining bias is the uncertainty of its mean.

    The mean contains the Earth's rotation, which is known.
    """
    gyro = grade.gyro
    known = math.hypot(gyro.in_run, gyro.white / math.sqrt(STANDSTILL_S))
    return replace(grade, gyro=replace(gyro, turn_on=min(gyro.turn_on, known)))
