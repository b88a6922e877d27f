"""Checksum, identifier and time of the messages of each driver, as far as faults can change them.

driver                checksum                                identifier                      document
--------------------  --------------------------------------  ------------------------------  -------------------------
multibeam_altimeter   CRC-32, last four bytes                 byte 6                          its docstring
nmea0183              hexadecimal digits after *              formatter                       NMEA 0183, 5.3
ublox_ubx             CK_B of Fletcher's sums                 number in the class             UBX-13003221, 32.2, 32.4
novatel_oem6          CRC-32, last four bytes; or digits      message number                  OM-20000129, 1.1, 1.7
imar_ixcom            CRC-16, last two bytes                  byte 1                          iXCOM, frame
mavlink               CRC-16 after the payload                message number                  MAVLink 2, serialization
lightware_binary      CRC-16, last two bytes                  byte 3                          LW20 product guide, LWNX
lightware_ascii       none                                    name of the answer (ldf)        SF11, LW20 manuals
freeflight_ra4500     byte 6, where its rule is known         none                            FreeFlight 84629
arinc429              parity; sum of a chapter 10 body        label; type of the packet       part 1; IRIG 106-22, 11.2
power_unit            hexadecimal digits after *              second field                    its docstring
ascii_line            the field {checksum}                    none                            the configuration
binary_struct         its configured position                 none                            the configuration
honeywell_hmr2300     none                                    none                            data sheet 900139
velodyne_vlp16        none                                    none                            manual 63-9243, 9.3
canaerospace, dbc,    done by the controller, which           CAN identifier                  ISO 11898-1, 10.4.2.6
deflection_pickups    rejects a frame with a wrong one

Clock faults need a driver that sends the time of the device.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from fti.config import StrictModel
from fti.drivers import arinc429
from fti.hil.faults import checksum_faults, identifier_faults
from fti.hil.faults.checksum_faults import MessageChange

CHECKSUMS: Mapping[str, Callable[[Any], MessageChange | None]] = {
    "arinc429": checksum_faults.arinc_change,
    "ascii_line": checksum_faults.line_change,
    "binary_struct": checksum_faults.frame_change,
    "freeflight_ra4500": checksum_faults.radar_altimeter_change,
    "imar_ixcom": checksum_faults.trailing_crc_change,
    "lightware_binary": checksum_faults.trailing_crc_change,
    "mavlink": checksum_faults.mavlink_change,
    "multibeam_altimeter": checksum_faults.trailing_crc_change,
    "nmea0183": checksum_faults.nmea_change,
    "novatel_oem6": checksum_faults.novatel_change,
    "power_unit": checksum_faults.nmea_change,
    "ublox_ubx": checksum_faults.ublox_change,
}
LABELS: Mapping[str, Callable[[Any], MessageChange | None]] = {
    "arinc429": identifier_faults.arinc_change,
    "canaerospace": identifier_faults.canaerospace_change,
    "dbc": identifier_faults.dbc_change,
    "deflection_pickups": identifier_faults.pickups_change,
    "imar_ixcom": identifier_faults.ixcom_change,
    "lightware_ascii": identifier_faults.lightware_change,
    "lightware_binary": identifier_faults.lwnx_change,
    "mavlink": identifier_faults.mavlink_change,
    "multibeam_altimeter": identifier_faults.multibeam_change,
    "nmea0183": identifier_faults.nmea_change,
    "novatel_oem6": identifier_faults.novatel_change,
    "power_unit": identifier_faults.power_unit_change,
    "ublox_ubx": identifier_faults.ublox_change,
}
#: Drivers that send the device's time; arinc429 in packets only.
DRIVERS_WITH_TIME = (
    "arinc429",
    "imar_ixcom",
    "mavlink",
    "multibeam_altimeter",
    "nmea0183",
    "novatel_oem6",
    "ublox_ubx",
    "velodyne_vlp16",
)


def checksum_change(driver: str, options: StrictModel) -> MessageChange | None:
    """The change that corrupts the checksum of a message; None if it has none."""
    make_change = CHECKSUMS.get(driver)
    return make_change(options) if make_change else None


def identifier_change(driver: str, options: StrictModel) -> MessageChange | None:
    """The change that makes the identifier of a message unknown; None if it has none."""
    make_change = LABELS.get(driver)
    return make_change(options) if make_change else None


def sends_time(driver: str, options: StrictModel) -> bool:
    """Does the device send its own time?"""
    if isinstance(options, arinc429.Options):
        return options.packets != "none"
    return driver in DRIVERS_WITH_TIME
