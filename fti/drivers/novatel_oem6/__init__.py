"""NovAtel OEM6 receivers (ProPak6, OEM638), binary messages; RS-232 10 Hz, or UDP.

Document: NovAtel OEM6 Family Firmware Reference Manual, OM-20000129 (messages, commands, logs); sizes and enumerations
as in the maker's message database (package ``novatel_edie`` 2.10).  Everything is little-endian; a frame is header,
body, CRC-32 (reflected 0xEDB88320, begun at 0, not inverted at the end) over header and body:

    long header   AA 44 12 | length of the header u8 (28) | message u16 | type u8 (bit 7: answer) | port u8 | body u16
                  10 sequence u16 | 12 idle u8 | time status u8 | 14 week u16 | 16 ms u32 | 20 receiver status u32
                  24 reserved u16 | 26 version u16
    short header  AA 44 13 | body u8 | message u16 | week u16 | ms u32          framed and counted by name
    ASCII         #NAME,...;...*crc32 CR LF (% for the short form)              framed, checked, counted by name
    answers       binary, <OK, <ERROR:text: Ack | #NAMER,...;text*crc32: Ack when refused | a prompt [COM1] is skipped

The bodies are decoded with our own tables, not by the maker's package, so that the tests can compare both
(docs/decisions/0010-novatel.md).  One module per family: ``solution`` (BESTPOS, BESTVEL), ``sky`` (PSRDOP, SATVIS,
SATVIS2), ``observations`` (RANGE, RANGECMP), ``ephemeris`` (RAWEPHEM), ``clock`` (TIME, CLOCKMODEL), ``status``
(RXSTATUS), ``commands``.  The header of OEM4 and OEMV receivers is the same; its length is read from the header.

t_dev_ns is the GPS time of the header if it is valid (FREEWHEELING, FINE, FINEBACKUPSTEERING, FINESTEERING), less the
latency of a velocity.  A position is valid when a solution was computed, in WGS84, and neither propagated without
satellites (PROPAGATED) nor entered (FIXEDPOS), like an NMEA fix "estimated" or "manual".  Messages of a second antenna
are only counted.

The receiver is silent until messages are requested: ``logs`` are requested after every connect and every
``ask_again_s``, because a restarted receiver has lost them, which the serial line does not show.  A repeated request
replaces the previous one.  The default baud rate of the receiver is 9600.  The emulated receiver sends RXSTATUS,
BESTVEL, BESTPOS, CLOCKMODEL, TIME, PSRDOP, SATVIS2 and RANGE.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, Field

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, key
from fti.drivers._framing import FramedDecoder
from fti.drivers.novatel_oem6 import commands
from fti.drivers.novatel_oem6.clock import stamp_of
from fti.drivers.novatel_oem6.encoder import Encoder
from fti.drivers.novatel_oem6.framing import (
    COUNTED_MAX,
    RESPONSE_BIT,
    SECOND_ANTENNA,
    SHORT_HEADER,
    SHORT_SYNC,
    SOURCE_BITS,
    SYNC,
    measure,
    split,
)
from fti.drivers.novatel_oem6.messages import NAMES, NUMBERS, READERS, name_of, number_of
from fti.messages.measurements import Stamp

DOCUMENT = "NovAtel OEM6 Family Firmware Reference Manual, OM-20000129; binary messages and commands"
MESSAGES = {
    "BESTPOS": "position, heights, sigma, kind of solution",
    "BESTVEL": "ground speed, track and vertical speed",
    "TIME": "time, offset of the receiver's clock, UTC - GPS",
    "CLOCKMODEL": "offset and drift of the receiver's clock, with sigma",
    "RANGE": "pseudorange, carrier phase, Doppler and C/N0 of every signal",
    "RANGECMP": "the same, compressed",
    "RAWEPHEM": "ephemeris of a GPS satellite",
    "PSRDOP": "dilution of precision and the satellites used",
    "SATVIS": "azimuth and elevation of the satellites above the horizon",
    "SATVIS2": "the same, a message for each system",
    "RXSTATUS": "error and status words, every bit by name",
    "response": "answer to a command",
    "(other)": "framed and counted by name or number",
}
CARRIERS = frozenset({"serial", "udp"})
COMMANDS, command = commands.COMMANDS, commands.command

#: Default logs: position and velocity at 10 Hz, others at lower rates.
AIRCRAFT_LOGS = {
    "bestpos": 0.1,
    "bestvel": 0.1,
    "time": 1.0,
    "clockmodel": 1.0,
    "psrdop": 1.0,
    "range": 1.0,
    "rxstatus": 1.0,
    "satvis2": 10.0,
}


def _checked_logs(logs: dict[str, float]) -> dict[str, float]:
    for message, period in logs.items():
        if number_of(message) not in NAMES:
            raise ValueError(f"message = {message!r}: must be one of {', '.join(sorted(NUMBERS))}")
        if period:
            commands.check_period(period)
    return logs


class Options(StrictModel):
    """Options of a NovAtel receiver."""

    logs: Annotated[
        dict[str, float],
        AfterValidator(_checked_logs),
        key("requested messages, each with its period; 0: at every change", "s"),
    ] = AIRCRAFT_LOGS
    ask_again_s: Annotated[
        float,
        Field(ge=0.0, le=3600.0),
        key("period of repeated requests, for a receiver that was restarted; 0: only after a connect", "s"),
    ] = 10.0
    unasked: Annotated[bool, key("of the emulated receiver: it sends all messages without requests", NO_UNIT)] = False


class Decoder(FramedDecoder):
    """Frames of the receiver to measurements."""

    def __init__(self, options: Options) -> None:
        super().__init__(measure, COUNTED_MAX)

    def _decode(self, frame: bytes, t_rx_ns: int) -> tuple[str, list[Any]]:
        if frame.startswith(SYNC):
            return _read_binary(frame, t_rx_ns)
        if frame.startswith(SHORT_SYNC):
            return name_of(SHORT_HEADER.unpack_from(frame)[2]), []
        if frame.startswith(b"<"):
            return "response", commands.decode_abbreviated(frame, Stamp(t_rx_ns))
        refused = commands.decode_ascii_answer(frame, Stamp(t_rx_ns))
        return ("response", refused) if refused is not None else (frame[1 : frame.index(b",")].decode("ascii"), [])


def _read_binary(frame: bytes, t_rx_ns: int) -> tuple[str, list[Any]]:
    header, body = split(frame)
    stamp = stamp_of(header, t_rx_ns)
    if header.message_type & RESPONSE_BIT:
        return "response", commands.decode_answer(header, body, stamp)
    name, reader = name_of(header.message_id), READERS.get(header.message_id)
    if header.message_type & SOURCE_BITS == SECOND_ANTENNA:
        return f"{name} of the second antenna", []
    return name, reader(body, header, stamp) if reader else []


make_decoder = Decoder


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder."""
    return Encoder(options.unasked)


def on_connect(options: Options) -> list[bytes]:
    """LOG for all configured messages."""
    return [commands.periodic_log_request(message, period) for message, period in options.logs.items()]


def poll(options: Options) -> tuple[float, bytes] | None:
    """The same periodically, for a receiver that was restarted."""
    requests = b"".join(on_connect(options))
    return (options.ask_again_s, requests) if requests and options.ask_again_s else None
