"""NMEA 0183 sentences of a GNSS receiver or compass.

Document: NMEA 0183 4.11 as publicly documented (gpsd, "NMEA Revealed", E. S. Raymond).

    $ talker(2) formatter(3) , field , field ... * checksum CR LF       ! in place of $ for encapsulated data

    GGA  time lat N lon E quality used hdop altMSL M undulation M age station
    GNS  time lat N lon E modes used hdop altMSL undulation age station [status]
    RMC  time status lat N lon E speed[kt] course[deg] ddmmyy variation E [mode [status]]
    GLL  lat N lon E time status [mode]                   GST  time rms major minor angle sdLat sdLon sdAlt
    VTG  course T course M speed N speed K [mode]         VTG  course course speed[kt] speed[km/h]   before 2.0
    ZDA  time dd mm yyyy zone                             HDT  heading T
    GSA  mode fix 12 x satellite pdop hdop vdop [system]  THS  heading mode
    GSV  sentences index in_view 4 x (satellite elevation azimuth cn0) [signal]
    PASHR  time heading T roll pitch heave sdRoll sdPitch sdHeading quality
    PUBX,00  time lat N lon E altHAE fix hAcc vAcc speed[km/h] course down age hdop vdop tdop used    (u-blox)
    PUBX,04  time ddmmyy tow week leap clockBias[ns] clockDrift[ns/s] granularity                     (u-blox)

Checksum: exclusive or of the bytes between start and asterisk; a sentence without one is rejected, unless the
option ``checksum`` is "optional".  Lines that begin with # are comments of capture files.  Other sentences are framed
and counted by name; those with invalid fields are counted as malformed.  The fields are decoded here, not by a package,
so that the tests can compare them with independent parsers.

Talkers GP GL GA GB BD GQ QZ GI identify the satellite system; for GN and others the number or the system identifier
of 4.11 does.  Satellites are numbered within their system, as in RINEX: GLONASS 65 is 1, SBAS 33 is 120, QZSS 193
is 1.  Each list of satellites has all systems, each satellite once with its strongest signal, and whether the last
GSA lists it as used.  The sigma of a GST holds for the positions of the next 10 s.  A VTG without mode
has the validity of the newest fix.  A dilution of precision of 0, or of 99 and above, means none.

alt = altMSL + undulation of the same sentence.  The device time is UTC after RMC or ZDA have set the date; a
sentence soon after midnight belongs to the new day.  The emulated receiver sends RMC and GGA for a Position (with
the Velocity and the Satellites of the same t_rx_ns), before them GST where it has a sigma, HDT for a heading, ZDA for a
DeviceTime.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Literal

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, key
from fti.drivers._framing import FramedDecoder, Skip
from fti.drivers._nmea_framing import MAX_SENTENCE, measure_sentence
from fti.drivers._nmea_sentences import Sentences
from fti.drivers._no_commands import COMMANDS, command, on_connect, poll  # noqa: F401 - the rest of the contract
from fti.formats import nmea_fields as fields
from fti.formats.device_time import device_time_ns, utc_date
from fti.formats.unit_factors import KNOT
from fti.geodesy.formulas import wrap_heading
from fti.messages.measurements import Attitude, DeviceTime, Measurement, Position, Satellites, TimeScale, Velocity

DOCUMENT = 'NMEA 0183 4.11 as publicly documented (gpsd, "NMEA Revealed")'
MESSAGES = {
    "GGA": "position, kind of fix, satellites used",
    "GNS": "position, satellites used",
    "RMC": "position, ground speed and track, date",
    "GLL": "position",
    "GST": "sigma of the position",
    "VTG": "ground speed and track",
    "GSA": "satellites used, dilution of precision",
    "GSV": "satellites in view",
    "ZDA": "date and time",
    "HDT": "true heading",
    "THS": "true heading",
    "PASHR": "roll, pitch, true heading",
    "PUBX,00": "position above the ellipsoid, velocity, accuracy, satellites used",
    "PUBX,04": "date and time, the receiver's clock",
    "(other)": "framed and counted by name",
}
CARRIERS = frozenset({"serial", "udp"})

_NO_START = re.compile(rb"[^$!#]+")
#: Dilution of precision that means none.
NO_DILUTION = 99.99
_COMMENT = re.compile(rb"[^$!\n]*\n?")


class Options(StrictModel):
    """Options of a receiver with text sentences."""

    checksum: Annotated[
        Literal["required", "optional"],
        key("optional: also for a device that sends none; a checksum that is sent must be correct", NO_UNIT),
    ] = "required"


# ------------------------------------------------------------------------------------------------------- framing


class SentenceFraming:
    """Framing; see ``fti.drivers._framing``.  Stateful: a comment may continue.

    bare : accept sentences without a checksum
    """

    def __init__(self, bare: bool) -> None:
        self._bare = bare
        self._comment = False

    def measure(self, buffer: bytearray) -> int | Skip:
        """Size of the sentence at the start of the buffer, or a Skip."""
        if buffer[0] in b"$!":
            self._comment = False
            return measure_sentence(buffer, self._bare)
        if buffer[0] == ord("#"):
            self._comment = True
        match = (_COMMENT if self._comment else _NO_START).match(buffer)
        assert match is not None
        if not self._comment:
            return Skip(match.end(), "no_sync")
        self._comment = buffer[match.end() - 1] != ord("\n")
        return Skip(match.end(), "comment")


# ------------------------------------------------------------------------------------------------------- streams


class Decoder(FramedDecoder):
    """Sentences to measurements."""

    def __init__(self, options: Options) -> None:
        super().__init__(SentenceFraming(options.checksum == "optional").measure, MAX_SENTENCE)
        self._sentences = Sentences()

    def _decode(self, frame: bytes, t_rx_ns: int) -> tuple[str, list[Measurement]]:
        return self._sentences.read(frame, t_rx_ns)


class Encoder:
    """The emulated receiver."""

    def __init__(self, options: Options) -> None:
        self._velocity: Velocity | None = None
        self._sky: Satellites | None = None

    def encode(self, measurement: Measurement) -> list[bytes]:
        if isinstance(measurement, Velocity):
            self._velocity = measurement
        elif isinstance(measurement, Satellites):
            self._sky = measurement
        elif isinstance(measurement, Position):
            return self._fix(measurement)
        elif isinstance(measurement, Attitude) and measurement.heading is not None:
            return [fields.sentence(f"GNHDT,{_degrees(measurement.heading)},T")]
        elif isinstance(measurement, DeviceTime):
            day, of_day_ns = utc_date(device_time_ns(measurement.stamp, TimeScale.UTC))
            return [fields.sentence(f"GNZDA,{fields.format_time(of_day_ns)},{day:%d,%m,%Y},00,00")]
        return []

    def respond(self, data: bytes) -> list[bytes]:
        return []

    def _fix(self, position: Position) -> list[bytes]:
        day, of_day_ns = utc_date(device_time_ns(position.stamp, TimeScale.UTC))
        time = fields.format_time(of_day_ns)
        here = f"{fields.format_angle(position.lat, 'NS', 2)},{fields.format_angle(position.lon, 'EW', 3)}"
        speed, track = self._speed_and_track(position.stamp.t_rx_ns)
        status, mode, quality = ("A", "A", 1) if position.valid else ("V", "N", 0)
        alt_msl = position.alt_msl
        if alt_msl is None and position.alt is not None and position.undulation is not None:
            alt_msl = position.alt - position.undulation
        height = f"{fields.format_number(alt_msl, 3)},M,{fields.format_number(position.undulation, 3)},M"
        sky = self._quality(position.stamp.t_rx_ns)
        return [
            *_sigma(time, position),
            fields.sentence(f"GNRMC,{time},{status},{here},{speed},{track},{day:%d%m%y},,,{mode}"),
            fields.sentence(f"GNGGA,{time},{here},{quality},{sky},{height},,"),
        ]

    def _quality(self, t_rx_ns: int) -> str:
        """Satellites used and HDOP; good values if none are given."""
        sky = self._sky
        if sky is None or sky.stamp.t_rx_ns != t_rx_ns:
            return "12,0.80"
        return f"{sky.used or 0:02d},{NO_DILUTION if sky.hdop is None else min(sky.hdop, NO_DILUTION):.2f}"

    def _speed_and_track(self, t_rx_ns: int) -> tuple[str, str]:
        v = self._velocity
        if v is None or v.stamp.t_rx_ns != t_rx_ns or not v.valid:
            return "", ""
        speed, track = v.ground_speed, v.track
        if v.north is not None and v.east is not None:
            speed, track = math.hypot(v.north, v.east), wrap_heading(math.atan2(v.east, v.north))
        return fields.format_number(None if speed is None else speed / KNOT, 3), "" if track is None else _degrees(
            track
        )


def _sigma(time: str, position: Position) -> list[bytes]:
    """GST, if the position has a sigma."""
    if position.horizontal_sd is None:
        return []
    horizontal, vertical = (fields.format_number(sd, 2) for sd in (position.horizontal_sd, position.vertical_sd))
    return [fields.sentence(f"GNGST,{time},,,,,{horizontal},{horizontal},{vertical}")]


def _degrees(heading: float) -> str:
    return f"{round(math.degrees(heading) * 1000) % 360_000 / 1000:.3f}"


make_decoder, make_encoder = Decoder, Encoder
