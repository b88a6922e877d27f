"""Decode a capture with one driver: measurements as JSON lines, and counters at the end.

  fti decode radalt.bin --driver freeflight_ra4500
  fti decode words.bin --driver arinc429 --option set=ahrs --option byte_order=little
  fti decode can.log --driver canaerospace --option dbc_file=air_data.dbc --json
  fti decode laser.bin --config aircraft.toml --device laser_altimeter

With --config and --device, driver and options are taken from a device of a configuration.  FILE holds the bytes of the
line.  For a CAN driver it is a text log of ``candump -L``, or a sequence of 16-byte ``can_frame``; a text log has
timestamps.  Other captures have no times: t_rx_ns is 0.

The counters account for every byte: framed, held (an incomplete frame), or skipped, by reason; they count the messages
of each name, and lost messages where messages are numbered.  With --json they are the last line of standard output,
{"counters": ...}; without, they are text on standard error.

A scan of a range scanner or imager is one line with its number of points and returns.  With --points the line has the
points, too: t_s after the message [s], range [m], direction (unit vector in the sensor frame) and intensity.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fti.cli._printing import print_line, print_lines

if TYPE_CHECKING:
    from io import BufferedReader

    from fti.config import StrictModel
    from fti.drivers import Counters, Decoder, Driver
    from fti.messages.measurements import RangeScan

Reads = Iterator[tuple[int, bytes]]  # (t_rx_ns, bytes of one read, datagram or CAN frame)
CAN_FRAME = 16  # struct can_frame of Linux
PEEK_BYTES = 4096
#: Beginning of a ``candump -L`` log, after empty lines and comments; and of any text.
CANDUMP = re.compile(rb"\s*(?:#[\t -~]*\s+)*\(\d+\.\d+\) ")
TEXT = re.compile(rb"[\t\r\n -~]+")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti decode``."""
    parser.add_argument("file", metavar="FILE", help="the capture")
    parser.add_argument("--driver", metavar="NAME", help="see fti drivers")
    parser.add_argument("--option", action="append", default=[], metavar="KEY=VALUE", help="an option of the driver")
    parser.add_argument("--config", metavar="CONFIG", help="with --device: the configuration of the device")
    parser.add_argument("--device", metavar="NAME", help="decode as this device of the configuration")
    parser.add_argument("--chunk", type=int, default=4096, metavar="N", help="bytes fed at a time (default 4096)")
    parser.add_argument("--points", action="store_true", help="print the points of scans, too")
    parser.add_argument("--json", action="store_true", help="print JSON only, with the counters as last line")


def run(args: argparse.Namespace) -> int:
    """Decode and print."""
    import sys

    from fti.errors import ConfigError, FtiError
    from fti.logger.encoding import encode
    from fti.messages.measurements import RangeScan

    if args.chunk < 1:
        raise ConfigError(f"--chunk = {args.chunk}: must be 1 or more")
    driver, decoder = device_decoder(args) if args.device or args.config else driver_decoder(args)
    try:
        with open_capture(Path(args.file)) as capture:
            for t_rx_ns, data in reads(driver, capture, args.chunk):
                for measurement in decoder.feed(data, t_rx_ns):
                    line: dict[str, Any] = {"measurement": type(measurement).__name__, "values": measurement}
                    if args.points and isinstance(measurement, RangeScan):
                        line["points"] = point_lists(measurement)
                    print_line(encode(line).decode())
        if args.json:
            print_line(encode({"counters": decoder.counters}).decode())
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise FtiError(f"{args.file}: decoding stopped: {error.strerror}") from None
    if not args.json:
        print_lines(_counter_lines(decoder.counters), error=True)
    return 0


def point_lists(scan: RangeScan) -> dict[str, list[Any]]:
    """The points of a scan by column; intensity is empty if the device states none."""
    from fti.ranging.scan_points import scan_points

    points = scan_points(scan)
    offsets_s = (points.times_ns - scan.stamp.t_rx_ns) / 1e9
    intensities = [] if points.intensities is None else points.intensities.tolist()
    return {
        "t_s": offsets_s.tolist(),
        "range": points.ranges.tolist(),
        "direction": points.directions_s.tolist(),
        "intensity": intensities,
    }


def driver_decoder(args: argparse.Namespace) -> tuple[Driver, Decoder]:
    """Driver and decoder of --driver and --option.  Raises ConfigError or MissingError."""
    from fti import drivers
    from fti.errors import ConfigError, MissingError

    if args.driver is None:
        raise ConfigError("--driver: missing; give --driver NAME, or --config CONFIG and --device NAME")
    if args.driver not in drivers.names():
        raise MissingError(f"no driver {args.driver!r}; drivers: {', '.join(drivers.names())}")
    driver = drivers.load(args.driver)
    try:
        return driver, driver.make_decoder(read_options(driver, args.option))
    except ValueError as error:
        raise ConfigError(f"--option: {error}") from None


def device_decoder(args: argparse.Namespace) -> tuple[Driver, Decoder]:
    """Driver and decoder of a device of a configuration.  Raises ConfigError or MissingError."""
    from fti import config
    from fti.devices import bind_devices
    from fti.errors import ConfigError, MissingError

    if not (args.device and args.config) or args.driver or args.option:
        raise ConfigError("--config and --device go together, and without --driver and --option")
    bound = {b.device.name: b for b in bind_devices(config.load(args.config))}
    if args.device not in bound:
        raise MissingError(f"{args.config}: no device {args.device!r}; configured: {', '.join(bound) or 'none'}")
    return bound[args.device].driver, bound[args.device].make_decoder()


def read_options(driver: Driver, pairs: list[str]) -> StrictModel:
    """The driver's options from KEY=VALUE; a value is read as TOML where it is TOML, else as text.

    Raises ConfigError or MissingError.
    """
    from fti import config
    from fti.devices import FILE_ENDING, read_text
    from fti.errors import ConfigError

    table: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals:
            raise ConfigError(f"--option = {pair!r}: must be KEY=VALUE")
        field = driver.Options.model_fields.get(key)
        table[key] = _value(text, is_text=field is not None and field.annotation is str)
        if key.endswith(FILE_ENDING):
            table[key.removesuffix(FILE_ENDING)] = read_text(Path(text))
    return config.bind(driver.Options, table, "--option")


def _value(text: str, *, is_text: bool) -> object:
    import tomllib

    try:
        value: object = tomllib.loads(f"value = {text}")["value"]
    except (ValueError, KeyError, RecursionError):
        return text
    return text if is_text and not isinstance(value, str) else value


def open_capture(file: Path) -> BufferedReader:
    """The capture, open.  Raises MissingError."""
    from fti.errors import MissingError

    try:
        return file.open("rb")
    except OSError as error:
        raise MissingError(f"{file}: cannot be read: {error.strerror}") from None


def reads(driver: Driver, capture: BufferedReader, chunk: int) -> Reads:
    """The capture in reads of ``chunk`` bytes, or in CAN frames.  Raises ConfigError."""
    from fti.errors import ConfigError

    if "can" not in driver.CARRIERS:
        return _pieces(capture, chunk)
    beginning, file = capture.peek(PEEK_BYTES)[:PEEK_BYTES], Path(capture.name)
    if CANDUMP.match(beginning):
        return candump_frames((line.decode("ascii", errors="replace") for line in capture), file)
    if TEXT.fullmatch(beginning):
        first = beginning.decode("ascii").strip().partition("\n")[0][:60]
        raise ConfigError(f"{file}: is text but not a candump -L log: {first!r}")
    return _pieces(capture, CAN_FRAME)


def _pieces(capture: BufferedReader, size: int) -> Reads:
    """The bytes to the end, ``size`` at a time."""
    while data := capture.read(size):
        yield 0, data


def candump_frames(lines: Iterable[str], file: Path) -> Reads:
    """Frames of a ``candump -L`` log: ``(seconds.micros) channel ID#DATA``.  Raises ConfigError naming the line."""
    from fti.errors import ConfigError

    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            yield _candump_frame(*line.split()[:3])
        except (ValueError, TypeError):
            raise ConfigError(f"{file}: line {number}: is not a candump line: {line[:60]!r}") from None


def _candump_frame(time: str, channel: str, frame: str) -> tuple[int, bytes]:
    from fti.canframe import ERROR, pack_can

    seconds, _, fraction = time.strip("()").partition(".")
    t_ns = int(seconds) * 1_000_000_000 + int(f"{fraction:0<9}"[:9])
    if not 0 <= t_ns < 2**63:
        raise ValueError("no time")
    word, fd, data = frame.partition("##") if "##" in frame else frame.partition("#")
    if not fd:
        raise ValueError("no #")
    can_id = int(word, 16)
    error = len(word) > 3 and bool(can_id & ERROR)
    payload = bytes.fromhex(data[1:] if fd == "##" else "" if data.startswith("R") else data)
    remote = data.startswith("R") and fd == "#"
    return t_ns, pack_can(
        can_id & ~ERROR if error else can_id, payload, extended=len(word) > 3 and not error, remote=remote, error=error,
        fd=fd == "##",
    )  # fmt: skip


def _counter_lines(counters: Counters) -> list[str]:
    messages = [f"  {name} {count}" for name, count in sorted(counters.messages.items())]
    skipped = [f"  {reason} {count}" for reason, count in sorted(counters.skipped.items())]
    lost = [f"  {name} {count}" for name, count in sorted(counters.lost.items())]
    totals = f"bytes {counters.bytes_in}: framed {counters.framed}, held {counters.held}"
    text = ["messages", *messages, f"{totals}, skipped {sum(counters.skipped.values())}", *skipped]
    return [*text, "lost", *lost] if lost else text
