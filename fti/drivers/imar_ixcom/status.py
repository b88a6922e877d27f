"""Status words: that of the frame footer, and those of SYSSTAT and GNSSSOL.

Names are those of the maker's package ``ixcom`` 1.3.10 in lower case (GlobalStatusBit, SysstatBit, EKF_STATUS_LOW,
EKF_STATUS_HIGH); of the GNSS receiver's word and of the second system word, those of the maker's header ``XCOMdat.h``.
Two differ: bit 14 of the system word is ``sysstat_gnss_invalid``, because the footer has a ``gnss_invalid`` too, and
bit 7, reserved in the package, is ``zupt_request`` as in the header.  Unpublished bits are
numbered.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

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


class Footer(NamedTuple):
    """Decoded status word, and validity of the data in its frame.

    flags : names of its conditions; ok : no error; is_aligned : of attitude and velocity; is_position_good : of the
    position; is_time_valid : of the time
    """

    flags: tuple[str, ...]
    ok: bool
    is_aligned: bool
    is_position_good: bool
    is_time_valid: bool


@lru_cache(maxsize=1024)
def decode_footer(status: int) -> Footer:
    """Decode the status word."""
    flags = decode_status(status)
    ok = ERRORS.isdisjoint(flags)
    is_aligned, is_position_good = ok and not ALIGNED.isdisjoint(flags), ok and not POSITION_GOOD.isdisjoint(flags)
    return Footer(flags, ok, is_aligned, is_position_good, "time_invalid" not in flags)


def decode_status(status: int) -> tuple[str, ...]:
    """Names of the conditions in the status word of the footer."""
    flags = [name for bit, name in enumerate(STATUS_FLAGS) if status >> bit & 1]
    return (*flags, ALIGNMENT[status >> 12 & 3], QUALITY[status >> 14 & 3])


@lru_cache(maxsize=256)
def encode_status(flags: tuple[str, ...]) -> int:
    """The status word; alignment and position quality are good unless the flags name them."""
    status = sum(1 << bit for bit, name in enumerate(STATUS_FLAGS) if name in flags)
    alignment = next((i for i, name in enumerate(ALIGNMENT) if name in flags), ALIGNMENT.index("heading_good"))
    quality = next((i for i, name in enumerate(QUALITY) if name in flags), QUALITY.index("position_high"))
    return status | alignment << 12 | quality << 14


# ------------------------------------------------------------------------------------------------ words of 32 bits

Names = tuple[str, ...]


def word_names(word: str, *known: str) -> Names:
    """Names of the 32 bits of a word; unknown bits have their number."""
    return known + tuple(f"{word}_bit_{bit}" for bit in range(len(known), 32))


SYSTEM = word_names(
    "sysstat", "imu_invalid", "imu_crc_error", "imu_timeout", "imu_sample_lost", "acc_x_overrange", "acc_y_overrange",
    "acc_z_overrange", "zupt_request", "omg_x_overrange", "omg_y_overrange", "omg_z_overrange", "invalid_cal",
    "bit_fail", "default_conf", "sysstat_gnss_invalid", "zupt_calib", "gnss_crc_error", "gnss_timeout", "ekf_error",
    "savedpos_error", "savedhdg_error", "mag_timeout", "madc_timeout", "license_expired", "in_motion",
    "odo_plausibility", "odo_hw_error", "waiting_initval", "pps_lost", "limited_accuracy", "rec_enabled", "fpga_nogo",
)  # fmt: skip
#: Flags with which DeviceStatus is not ok.
SYSTEM_ERRORS = frozenset({
    "imu_invalid", "imu_crc_error", "imu_timeout", "invalid_cal", "bit_fail", "ekf_error", "fpga_nogo",
})  # fmt: skip
EKF_LOW = word_names(
    "ekf_low", "posllh_update", "posllh_lat_outlier", "posllh_lon_outlier", "posllh_alt_outlier", "vned_update",
    "vned_vn_outlier", "vned_ve_outlier", "vned_vd_outlier", "height_update", "height_outlier", "baroheight_update",
    "baroheight_outlier", "vbdy_update", "vbdy_vx_outlier", "vbdy_vy_outlier", "vbdy_vz_outlier", "vodo_update",
    "vodo_outlier", "vair_update", "vair_outlier", "hdgt_update", "hdgt_outlier", "hdgm_update", "hdgm_outlier",
    "magfield_update", "magfield_hx_outlier", "magfield_hy_outlier", "magfield_hz_outlier", "pseudorange_update",
    "rangerate_update", "time_update", "zupt_update",
)  # fmt: skip
EKF_HIGH = word_names(
    "ekf_high", "ekf_rtkllh_update", "ekf_rtkllh_lon_outlier", "ekf_rtkllh_lat_outlier", "ekf_rtkllh_alt_outlier",
    "ekf_dualant_update", "ekf_dualant_outlier", "ekf_cog_update", "ekf_cog_outlier", "ekf_tdcp_update",
    "ekf_tdcp_dd_update", "ekf_odo_alongtrack_update", "ekf_odo_alongtrack_outlier", "ekf_odo_constraint_update",
    "ekf_odo_constraint_outlier", "ekf_gravity_update", "ekf_gravity_outlier", "ekf_extpos_update",
    "ekf_extpos_outlier", "ekf_extvel_update", "ekf_extvel_outlier", "ekf_zaru_update", "ekf_wahba_vel_too_old",
    "ekf_wahba_pos_too_old", "ekf_wahba_insuffobs", "ekf_wahba_update", "ekf_wahba_filter", "ekf_filter_mode_0",
    "ekf_filter_mode_1", "ekf_wahba_internal", "ekf_levelling_complete", "ekf_stationary_align_complete",
    "ekf_position_valid",
)  # fmt: skip
GNSS = word_names(
    "gnss_status", "gnss_invalid_firmware", "gnss_rom_status", "gnss_supply_voltage", "gnss_pll_rf1_error",
    "gnss_pll_rf2_error", "gnss_sw_resource_limit", "gnss_invalid_model", "gnss_hw_failure", "gnss_temp_error",
    "gnss_primary_antenna_power", "gnss_primary_antenna_open", "gnss_primary_antenna_shorted", "gnss_cpu_overload",
    "gnss_com1_buffer_overrun", "gnss_com2_buffer_overrun", "gnss_com3_buffer_overrun", "gnss_almanac_flag",
    "gnss_solution_invalid", "gnss_voltage_supply", "gnss_update_in_progress", "gnss_solution_code_type",
    "gnss_secondary_antenna_open", "gnss_secondary_antenna_shorted", "gnss_secondary_antenna_power",
)  # fmt: skip
SYSTEM_2 = word_names("sysstat2", "maintiming_error", "rtc_error")


@lru_cache(maxsize=256)
def decode_word(word: int, names: Names) -> tuple[str, ...]:
    """Names of the bits that are set."""
    return tuple(name for bit, name in enumerate(names) if word >> bit & 1)


@lru_cache(maxsize=256)
def encode_word(flags: tuple[str, ...], names: Names) -> int:
    """The word in which the bits that the flags name are set."""
    return sum(1 << bit for bit, name in enumerate(names) if name in flags)
