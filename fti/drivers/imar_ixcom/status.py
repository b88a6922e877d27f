"""The status word that stands in the footer of every frame."""

from __future__ import annotations

STATUS_FLAGS = (
    "hardware_error", "communication_error", "navigation_error", "calibration_error", "gyro_overrange",
    "accel_overrange", "gnss_invalid", "standby", "dynamic_align", "time_invalid", "navigation_mode", "ahrs_mode",
)  # fmt: skip
ALIGNMENT = ("levelling", "aligning", "align_complete", "heading_good")
QUALITY = ("position_bad", "position_medium", "position_high", "position_undefined")
ERRORS = frozenset(STATUS_FLAGS[:6]) | {"standby"}
ALIGNED = frozenset(ALIGNMENT[2:])
POSITION_GOOD = frozenset({"position_medium", "position_high"})
HEALTHY: tuple[str, ...] = ("navigation_mode", "heading_good", "position_high")


def decode_status(status: int) -> tuple[str, ...]:
    """Names of the conditions in the footer's status word."""
    flags = [name for bit, name in enumerate(STATUS_FLAGS) if status >> bit & 1]
    return (*flags, ALIGNMENT[status >> 12 & 3], QUALITY[status >> 14 & 3])


def encode_status(flags: tuple[str, ...]) -> int:
    """The status word; alignment and position quality are good where the flags do not name them."""
    status = sum(1 << bit for bit, name in enumerate(STATUS_FLAGS) if name in flags)
    alignment = next((i for i, name in enumerate(ALIGNMENT) if name in flags), ALIGNMENT.index("heading_good"))
    quality = next((i for i, name in enumerate(QUALITY) if name in flags), QUALITY.index("position_high"))
    return status | alignment << 12 | quality << 14
