"""Units of the wires, each as a factor to SI."""

from __future__ import annotations

import math

from fti.constants import FOOT, NAUTICAL_MILE

KNOT = NAUTICAL_MILE / 3600.0
FOOT_PER_MINUTE = FOOT / 60.0
HECTOPASCAL = 100.0
INCH_HG = 3386.389  # at 0 degrees Celsius
DEGREE = math.pi / 180.0
KELVIN_AT_0_C = 273.15
