"""Every decoder under a fully loaded line of its kind, and at ten times the rate of the research aircraft.

    python benchmarks/decoders.py [--seconds S] [DRIVER ...]

The bytes are those of the drivers' test vectors, again and again, in reads of the line's size: up to 64 bytes of
a serial line, a datagram, a CAN frame.  "Full line" is what the line can carry (baud rate / 10 bytes; 2778 words/s of
ARINC 429 at 100 kbit/s; 8000 frames/s of CAN at 1 Mbit/s); "10 x" is ten times the update rate of Spiegel 2018,
table 6.1, or of the device's own document; of the laser scanner 10,000 points/s.  Target of both: 10 % of a core.  Of
nine rounds over all decoders the fastest counts, which excludes the load of other processes.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts import parsers
from benchmarks.parts.machine import Targets, machine
from tests.drivers.vectorfiles import Vector, load

MAX_CORE_PERCENT = 10.0  # %
ROUNDS = 9
SERIAL_READ = 64
WORD_BYTES, WORDS_HZ = 4, 2778
CAN_BYTES, CAN_HZ = 16, 8000
INSSOL_BYTES = 92
VLP16_BYTES = 1206


class Case(NamedTuple):
    """A driver on its line.

    vector : the test vector whose bytes it gets; line : its kind, full_line : its capacity [B/s]
    rate_hz : messages/s of the aircraft; parser : the alternative of a user; read : bytes of one read
    """

    vector: str
    line: str
    full_line: float
    rate_hz: float
    parser: parsers.Parser | None = None
    read: int = SERIAL_READ


def _serial(baud: int) -> tuple[str, float]:
    return f"{baud} baud", baud / 10


_CAN = "CAN 1 Mbit/s", float(CAN_BYTES * CAN_HZ)
CASES = {
    "imar_ixcom": Case("imar_ixcom_printed", "UDP 3000/s", 3000.0 * INSSOL_BYTES, 300, parsers.run_ixcom, INSSOL_BYTES),
    "novatel_oem6": Case("novatel_oem6_own", *_serial(115200), 10, parsers.run_novatel_edie),
    "ublox_ubx": Case("ublox_ubx_neo_m8t", *_serial(921600), 10, parsers.run_pyubx2),
    "nmea0183": Case("nmea0183_trimble", *_serial(115200), 10, parsers.run_pynmeagps),
    "mavlink": Case("mavlink_c_library", *_serial(921600), 50, parsers.run_pymavlink),
    "freeflight_ra4500": Case("freeflight_ra4500_table", *_serial(57600), 25),
    "ascii_line": Case("ascii_line_ilm500", *_serial(115200), 9),
    "lightware_ascii": Case("lightware_ascii_line", *_serial(115200), 50),
    "lightware_binary": Case("lightware_binary_distance", *_serial(115200), 50),
    "binary_struct": Case("binary_struct_tfmini_plus", *_serial(115200), 100),
    "honeywell_hmr2300": Case("honeywell_hmr2300_binary", *_serial(19200), 20),
    "arinc429": Case("arinc429_ahrs", "ARINC 429", float(WORD_BYTES * WORDS_HZ), 50, parsers.run_arinc429),
    "velodyne_vlp16": Case("velodyne_vlp16_recording", "UDP 1508/s", 1508.0 * VLP16_BYTES, 26, read=VLP16_BYTES),
    "canaerospace": Case("canaerospace_libcanaerospace", *_CAN, 10 * 15, parsers.run_cantools),
    "dbc": Case("dbc_air_data", *_CAN, 10 * 15),
    "deflection_pickups": Case("deflection_pickups_tail", *_CAN, 10 * 10),
}


def reads_of(vector: Vector, size: int, read: int) -> list[bytes]:
    """About ``size`` bytes of the vector in reads of its line."""
    if vector.is_can:
        return list(itertools.islice(itertools.cycle(vector.reads()), size // CAN_BYTES))
    data = vector.data * (size // len(vector.data) + 1)
    return [data[at : at + read] for at in range(0, len(data), read)]


def decode(vector: Vector, reads: Sequence[bytes]) -> tuple[float, int]:
    """Processor time [s] and number of messages."""
    decoder = vector.decoder()
    begin = time.process_time()
    for t_rx_ns, data in enumerate(reads):
        decoder.feed(data, t_rx_ns)
    return time.process_time() - begin, sum(decoder.counters.messages.values())


def parse(parser: parsers.Parser, reads: Sequence[bytes]) -> tuple[float, int]:
    """The same with a ready-made parser."""
    begin = time.process_time()
    count = parser(reads)
    return time.process_time() - begin, count


class Bench:
    """A prepared case; ``fastest`` and ``parsed`` are the fastest (processor time [s], messages) so far."""

    def __init__(self, name: str, seconds: float) -> None:
        self.name, self.case = name, CASES[name]
        self._vector = load(self.case.vector)
        self._reads = reads_of(self._vector, int(self.case.full_line * seconds), self.case.read)
        self.line_s = sum(map(len, self._reads)) / self.case.full_line
        self.fastest = self.parsed = (float("inf"), 1)

    def round(self) -> None:
        """One more round."""
        self.fastest = min(self.fastest, decode(self._vector, self._reads))
        if self.case.parser:
            self.parsed = min(self.parsed, parse(self.case.parser, self._reads))

    def print_row(self, targets: Targets) -> None:
        """Print a row."""
        case, (fastest, count) = self.case, self.fastest
        full, tenfold = 100 * fastest / self.line_s, 100 * fastest / count * 10 * case.rate_hz
        other = ""
        if case.parser:
            other = f"{1e6 * self.parsed[0] / self.parsed[1]:9.1f} {case.parser.__name__.removeprefix('run_')}"
        loads = f"{full:9.2f} % {case.rate_hz:6g}/s {tenfold:8.2f} %"
        print(f"{self.name:20} {case.line:14} {1e6 * fastest / count:7.1f} {loads}  {other}".rstrip(), flush=True)
        targets.check(f"{self.name}: at most {MAX_CORE_PERCENT:g} % of a core", max(full, tenfold) <= MAX_CORE_PERCENT)


def main() -> int:
    """Measure and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drivers", nargs="*", metavar="DRIVER", help=f"of {', '.join(CASES)}")
    parser.add_argument("--seconds", type=float, default=2.0, help="of a full line in a round (default 2)")
    args = parser.parse_args()
    if unknown := sorted(set(args.drivers) - set(CASES)):
        parser.error(f"no case for {', '.join(unknown)}; there are {', '.join(CASES)}")
    benches = [Bench(name, args.seconds) for name in args.drivers or CASES]
    for _ in range(ROUNDS):
        for bench in benches:
            bench.round()
    print(machine())
    print(f"{'driver':20} {'line':14} {'us each':>7} {'full line':>11} {'rate':>8} {'10 x that':>10}  instead: us each")
    targets = Targets()
    for bench in benches:
        bench.print_row(targets)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
