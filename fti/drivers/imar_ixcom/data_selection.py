"""Bits of the data selection in INSSOL, which defines the contents of its fields."""

from __future__ import annotations

IMU_RAW, IMU_CORRECTED, IMU_GRAVITY_FREE = 1 << 0, 1 << 1, 1 << 2
VEL_NED, VEL_ENU, VEL_ECEF, VEL_BODY = 1 << 3, 1 << 4, 1 << 5, 1 << 6
ALT_WGS84, ALT_MSL, ALT_BARO = 1 << 7, 1 << 8, 1 << 9
LON_LAT = 1 << 10
RPY_DIN70000 = 1 << 15
#: Selection of the emulated device, and default for a data selection of 0.
DEFAULT_SELECTION = IMU_CORRECTED | VEL_NED | ALT_WGS84 | LON_LAT
