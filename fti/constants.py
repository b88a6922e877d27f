"""Defined constants of the SI and of the units of aviation."""

from __future__ import annotations

#: SI brochure, ninth edition: speed of light in vacuum [m/s].
SPEED_OF_LIGHT = 299_792_458.0
#: Third CGPM, 1901: standard acceleration of gravity, the "g" of instruments [m/s^2].
STANDARD_GRAVITY = 9.80665
#: International foot and nautical mile [m].
FOOT = 0.3048
NAUTICAL_MILE = 1852.0
SECOND_NS = 1_000_000_000
