"""u-blox receivers: UBX, and the NMEA 0183 and RTCM 3 that the same port carries.

Document: u-blox 8 / M8 Receiver Description including Protocol Specification, UBX-13003221 R28 (2022); u-blox F9 HPG
1.32 Interface Description, UBX-22008968; for the older messages u-blox 6, GPS.G6-SW-10018.  Everything is
little-endian:

    0xB5 0x62 | class u8 | id u8 | length u16 of the payload | payload | CK_A CK_B: Fletcher-8 from class to payload

    01 07 NAV-PVT   92 B  0 iTOW u32 [ms] | 4 year u16, month, day, hour, minute, second u8 | 11 valid | 12 tAcc u32
                          16 nano i32 [ns] | 20 fixType | 21 flags | 22 flags2 | 23 numSV | 24 lon, lat i32 [1e-7 deg]
                          32 height, hMSL i32 [mm] | 40 hAcc, vAcc u32 [mm] | 48 velN, velE, velD, gSpeed i32 [mm/s]
                          64 headMot i32 [1e-5 deg] | 68 sAcc u32 [mm/s] | 72 headAcc u32 | 76 pDOP u16 [0.01]
                          78 flags3 (bit 0 invalidLlh) | 84 headVeh i32 | 88 magDec i16 | 90 magAcc u16
    01 35 NAV-SAT         0 iTOW | 4 version | 5 n | 8 n x: gnssId, svId, cno [dB-Hz] u8, elev i8, azim i16 [deg],
                          prRes i16 [0.1 m], flags u32 (bit 3 used)
    01 22 NAV-CLOCK 20 B  0 iTOW | 4 clkB i32 [ns] | 8 clkD i32 [ns/s] | 12 tAcc u32 [ns] | 16 fAcc u32 [ps/s]
    01 04 NAV-DOP   18 B  0 iTOW | 4 g, p, t, v, h, n, e u16 [0.01]
    02 15 RXM-RAWX        0 rcvTow f64 [s] | 8 week u16 | 10 leapS i8 | 11 n | 12 recStat | 16 n x: prMes f64 [m],
                          cpMes f64 [cycles], doMes f32 [Hz], gnssId, svId, sigId, freqId, locktime u16 [ms], cno,
                          prStdev [0.01 m x 2^n], cpStdev [0.004 cycles], doStdev, trkStat (0 range, 1 phase valid)
    02 13 RXM-SFRBX       0 gnssId, svId, sigId u8 | 4 numWords | 8 n x word u32: subframes of GPS L1 C/A
    05 01 ACK-ACK, 05 00 ACK-NAK   class, id of the request
    older: NAV-SOL 01 06, NAV-POSLLH 01 02, NAV-VELNED 01 12, NAV-STATUS 01 03, NAV-SVINFO 01 30, RXM-RAW 02 10

Valid: a fix of 2D, 3D or GNSS with dead reckoning with gnssFixOK set; dead reckoning only and "time only" (a surveyed
antenna) are not measured positions.  In a 2D fix the receiver keeps its last height, with the stated accuracy.
NAV-POSLLH, NAV-HPPOSLLH and NAV-VELNED have no fix: the newest fix of NAV-PVT, -SOL or -STATUS is used, and an accuracy
limit of 100 m (m/s).  Accuracies are used as one sigma, the horizontal one as that of the distance; that of NAV-SOL is
of the whole vector and bounds both parts.

Time: NAV-PVT and -TIMEUTC have UTC (validDate and validTime), others the GPS week with the second, or only iTOW; the
week then comes from other messages.  RXM-RAWX has the clock of the receiver.  Satellites are numbered within their
system, as in RINEX.  Messages of class NAV2 (the second solution), and all others, are framed and counted by name.

The decoder does not use ``pyubx2``, which needs up to 90 % of a core for a full line (docs/decisions/0011).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import NamedTuple

from fti.drivers._framing import FramedDecoder
from fti.drivers._nmea_sentences import Sentences
from fti.drivers.ublox_ubx import answers, navigation, raw, sky, subframes, times
from fti.drivers.ublox_ubx.commands import COMMANDS, Options, command, on_connect, poll
from fti.drivers.ublox_ubx.encoder import Encoder
from fti.drivers.ublox_ubx.frames import HEADER, MAX_HELD_BYTES, RTCM_START, SYNC, PayloadShape, PortFraming, rtcm_name
from fti.drivers.ublox_ubx.receiver_state import ReceiverState
from fti.messages.measurements import Measurement

__all__ = [
    "CARRIERS", "COMMANDS", "DOCUMENT", "MESSAGES", "Options", "command", "make_decoder", "make_encoder", "on_connect",
    "poll",
]  # fmt: skip

DOCUMENT = "u-blox 8 / M8 protocol specification UBX-13003221 R28; u-blox F9 HPG 1.32 interface UBX-22008968"
CARRIERS = frozenset({"serial", "udp"})


class UbxMessage(NamedTuple):
    """A message that is decoded."""

    name: str
    carries: str
    read: Callable[[bytes, ReceiverState, int], list[Measurement]]
    shape: PayloadShape | None


MESSAGE_TABLE = {
    (0x01, 0x02): UbxMessage("NAV-POSLLH", "position", navigation.read_posllh, PayloadShape(28)),
    (0x01, 0x03): UbxMessage("NAV-STATUS", "kind of fix", navigation.read_status, PayloadShape(16)),
    (0x01, 0x04): UbxMessage("NAV-DOP", "dilution of precision", sky.read_dop, PayloadShape(18)),
    (0x01, 0x05): UbxMessage("NAV-ATT", "attitude", navigation.read_att, PayloadShape(32)),
    (0x01, 0x06): UbxMessage(
        "NAV-SOL", "position, velocity, fix, satellites used", navigation.read_sol, PayloadShape(52)
    ),
    (0x01, 0x07): UbxMessage(
        "NAV-PVT", "position, velocity, fix, satellites used, UTC", navigation.read_pvt, PayloadShape(84)
    ),
    (0x01, 0x12): UbxMessage("NAV-VELNED", "velocity", navigation.read_velned, PayloadShape(36)),
    (0x01, 0x14): UbxMessage("NAV-HPPOSLLH", "position with more digits", navigation.read_hpposllh, PayloadShape(36)),
    (0x01, 0x20): UbxMessage("NAV-TIMEGPS", "GPS time", times.read_timegps, PayloadShape(16)),
    (0x01, 0x21): UbxMessage("NAV-TIMEUTC", "UTC", times.read_timeutc, PayloadShape(20)),
    (0x01, 0x22): UbxMessage(
        "NAV-CLOCK", "offset and drift of the receiver's clock", times.read_clock, PayloadShape(20)
    ),
    (0x01, 0x30): UbxMessage("NAV-SVINFO", "satellites in view", sky.read_svinfo, sky.SVINFO_SHAPE),
    (0x01, 0x35): UbxMessage("NAV-SAT", "satellites in view", sky.read_sat, sky.SAT_SHAPE),
    (0x02, 0x10): UbxMessage("RXM-RAW", "pseudoranges", raw.read_raw, raw.RAW_SHAPE),
    (0x02, 0x13): UbxMessage("RXM-SFRBX", "ephemerides of GPS satellites", subframes.read_sfrbx, subframes.SFRBX_SHAPE),
    (0x02, 0x15): UbxMessage("RXM-RAWX", "pseudoranges, carrier phases, dopplers", raw.read_rawx, raw.RAWX_SHAPE),
    (0x05, 0x00): UbxMessage("ACK-NAK", "a command was refused", answers.read_nak, PayloadShape(2)),
    (0x05, 0x01): UbxMessage("ACK-ACK", "a command was accepted", answers.read_ack, PayloadShape(2)),
    (0x28, 0x00): UbxMessage(
        "HNR-PVT", "position, ground speed, track, fix, UTC", navigation.read_hnr_pvt, PayloadShape(72)
    ),
    (0x0A, 0x04): UbxMessage("MON-VER", "versions of hardware and software", answers.read_version, None),
}
MESSAGES = {
    **{message.name: message.carries for message in MESSAGE_TABLE.values()},
    "GGA, RMC, ...": "NMEA 0183: as in the driver nmea0183",
    "RTCM n": "RTCM 3 corrections: framed and counted by number",
    "(other)": "framed and counted by name or number",
}
SHAPES = {ids: message.shape for ids, message in MESSAGE_TABLE.items() if message.shape}


class Decoder(FramedDecoder):
    """UBX, NMEA 0183 and RTCM 3 to measurements."""

    def __init__(self, options: Options) -> None:
        super().__init__(PortFraming(SHAPES).measure, MAX_HELD_BYTES)
        self._receiver = ReceiverState()
        self._sentences = Sentences()

    def _decode(self, frame: bytes, t_rx_ns: int) -> tuple[str, list[Measurement]]:
        if frame[0] == RTCM_START:
            return rtcm_name(frame), []
        if frame[0] != SYNC[0]:
            return self._sentences.read(frame, t_rx_ns)
        message = MESSAGE_TABLE.get((frame[2], frame[3]))
        if message is None:
            return answers.name_of(frame[2], frame[3]), []
        try:
            return message.name, message.read(frame[HEADER:-2], self._receiver, t_rx_ns)
        except (struct.error, ValueError, IndexError, OverflowError):
            return f"{message.name} malformed", []


make_decoder, make_encoder = Decoder, Encoder
