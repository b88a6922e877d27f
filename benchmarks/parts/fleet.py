"""23 devices, each on a link of its own: the aircraft of table 6.1 of Spiegel 2018, with sensors two and three times.

The inertial system with both its outputs once; every other sensor of the table three times, at the table's rates; two
buses of pickups; and four devices of other kinds.  A GNSS receiver that sends on its own replaces the one of the table,
which sends logs on request only.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from benchmarks.parts.processes import ROOT, port_of, udp_links


class Row(NamedTuple):
    """A device: driver, rate, kind of its link, options as TOML."""

    driver: str
    rate_hz: float
    kind: str
    options: str = ""


TABLE = {
    "ins": Row("imar_ixcom", 100, "serial"),
    "ins_fast": Row("imar_ixcom", 300, "udp"),
}
TABLE_THRICE = {
    "gnss": Row("nmea0183", 10, "serial"),
    "air_data": Row("canaerospace", 10, "can"),
    "laser": Row("lightware_ascii", 9, "serial"),
    "radar": Row("freeflight_ra4500", 25, "serial"),
    "magnetometer": Row("honeywell_hmr2300", 20, "serial"),
}
OTHERS = {
    "second_gnss": Row("ublox_ubx", 10, "serial"),
    "ahrs": Row("arinc429", 25, "serial", '{ set = "ahrs" }'),
    "autopilot": Row("mavlink", 50, "udp"),
    "scanner": Row("lightware_binary", 50, "serial"),
}
CALIBRATION = ROOT / "configs" / "calibrations" / "da42_pickups.csv"
PICKUPS = Row(
    "deflection_pickups",
    10,
    "can",
    f'{{ nodes = ["left_wing", "flaps", "pilot_controls"], calibration_file = "{CALIBRATION}" }}',
)
#: 4 x 100 solutions of an INS a second need more than the 230400 baud of the aircraft.
ENDS = {
    "serial": 'port = "/dev/unused"\nbaud = 921600\n',
    "can": 'interface = "slcan"\nchannel = "/dev/unused"\nbitrate = 1000000\n',
}
DEVICES = {
    **TABLE,
    **{f"{name}_{n}": row for n in range(1, 4) for name, row in TABLE_THRICE.items()},
    **{f"pickups_{n}": PICKUPS for n in range(1, 3)},
    **OTHERS,
}


def write_config(folder: Path, factor: float) -> Path:
    """The configuration of all of them, at a multiple of their rates."""
    udp = iter(udp_links(len(DEVICES)))
    parts = ['[session]\nname = "fleet"\ndirectory = "unused"\n']
    for name, (driver, rate_hz, kind, options) in DEVICES.items():
        end = f'bind = "127.0.0.1:{port_of(next(udp))}"\n' if kind == "udp" else ENDS[kind]
        parts.append(f'[[link]]\nname = "{name}"\nkind = "{kind}"\n{end}')
        parts.append(
            f'[[device]]\nname = "{name}"\nlink = "{name}"\ndriver = "{driver}"\nrate_hz = {factor * rate_hz}\n'
            + (f"options = {options}\n" if options else "")
        )
    file = folder / "fleet.toml"
    file.write_text("\n".join(parts))
    return file
