"""What of a message a fault can be of, by driver: its checksum, its identifier, its time.

driver                checksum                                identifier                      document
--------------------  --------------------------------------  ------------------------------  -------------------------
nmea0183              hexadecimal digits behind *             formatter                       NMEA 0183, 5.3
ublox_ubx             CK_B of Fletcher's sums                 number in the class             UBX-13003221, 32.2, 32.4
novatel_oem6          CRC-32, last four bytes; or digits      message number                  OM-20000129, 1.1, 1.7
imar_ixcom            CRC-16, last two bytes                  byte 1                          iXCOM, frame
mavlink               CRC-16 behind the payload               message number                  MAVLink 2, serialization
lightware_binary      CRC-16, last two bytes                  byte 3                          LW20 product guide, LWNX
lightware_ascii       none                                    name of the answer (ldf)        SF11, LW20 manuals
freeflight_ra4500     byte 6, where its rule is known         none                            FreeFlight 84629
arinc429              parity; sum of a chapter 10 body        label; type of the packet       part 1; IRIG 106-22, 11.2
power_unit            hexadecimal digits behind *             second field                    its docstring
ascii_line            where {checksum} stands                 none                            the configuration
binary_struct         where the description has it            none                            the configuration
honeywell_hmr2300     none                                    none                            data sheet 900139
canaerospace, dbc,    the controller's: a frame in which      CAN identifier                  ISO 11898-1, 10.4.2.6
deflection_pickups    it is wrong never comes out of one

A device's time: where it is on the wire; without it no fault of its clock can be seen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from fti.config import StrictModel
from fti.drivers import arinc429
from fti.hil.faults import checksums, labels
from fti.hil.faults.checksums import Change

CHECKSUMS: Mapping[str, Callable[[Any], Change | None]] = {
    "arinc429": checksums.of_arinc,
    "ascii_line": checksums.of_line,
    "binary_struct": checksums.of_frame,
    "freeflight_ra4500": checksums.of_radar_altimeter,
    "imar_ixcom": checksums.at_end,
    "lightware_binary": checksums.at_end,
    "mavlink": checksums.of_mavlink,
    "nmea0183": checksums.of_nmea,
    "novatel_oem6": checksums.of_novatel,
    "power_unit": checksums.of_nmea,
    "ublox_ubx": checksums.of_ublox,
}
LABELS: Mapping[str, Callable[[Any], Change | None]] = {
    "arinc429": labels.of_arinc,
    "canaerospace": labels.of_canaerospace,
    "dbc": labels.of_dbc,
    "deflection_pickups": labels.of_pickups,
    "imar_ixcom": labels.of_ixcom,
    "lightware_ascii": labels.of_lightware,
    "lightware_binary": labels.of_lwnx,
    "mavlink": labels.of_mavlink,
    "nmea0183": labels.of_nmea,
    "novatel_oem6": labels.of_novatel,
    "power_unit": labels.of_power_unit,
    "ublox_ubx": labels.of_ublox,
}
#: Drivers that send the device's time; arinc429 in packets only.
TIMED = ("arinc429", "imar_ixcom", "mavlink", "nmea0183", "novatel_oem6", "ublox_ubx")


def checksum_of(driver: str, options: StrictModel) -> Change | None:
    """What makes the checksum of a message wrong; None where it has none."""
    made = CHECKSUMS.get(driver)
    return made(options) if made else None


def label_of(driver: str, options: StrictModel) -> Change | None:
    """What makes the identifier of a message another one; None where it has none."""
    made = LABELS.get(driver)
    return made(options) if made else None


def sends_time(driver: str, options: StrictModel) -> bool:
    """Is the device's own time in what it sends?"""
    if isinstance(options, arinc429.Options):
        return options.packets != "none"
    return driver in TIMED
