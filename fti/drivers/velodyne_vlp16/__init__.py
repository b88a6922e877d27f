r"""Velodyne VLP-16 (Puck) and Puck LITE: a laser scanner of 16 beams that turns 5 to 20 times a second, over UDP.

Document: Velodyne VLP-16 User Manual, 63-9243 Rev. D; sections 9.1 and 9.2 (axes, vertical angles: table 9-1), 9.3
(packets: tables 9-2 to 9-4), 9.4 (times) and 9.5 (azimuths).

Data packet, port 2368, 1206 bytes, little-endian; 754 a second, with two returns 1508:

    byte    0   12 blocks of 100 bytes
                   0   FF EE
                   2   uint16  azimuth [deg / 100], 0 to 35999, when the first laser of the block fires
                   4   32 channels of 3 bytes: uint16 distance [2 mm], 0 without a return; uint8 reflectivity
         1200   uint32  time of the first firing [us] since the full hour of UTC, or since power-on, modulo one hour
         1204   uint8   returns: 37 hex strongest, 38 last, 39 both
         1205   uint8   product: 22 hex VLP-16 and Puck LITE

The channels of a block are two firing sequences of the 16 lasers.  Laser i of sequence j fires at

    t = 2.304 us i + 55.296 us j + 110.592 us (block; of both returns: pair of blocks)

after the time of the packet, when the azimuth has moved by the same share of the way to the next block (the last block:
as far as the one before it).  With both returns a pair of blocks has the last and the strongest return of the same
firings; a single return is in both.  In the frame of the scanner, z is the axis of rotation and y the azimuth 0:

    direction_s = (cos(w) sin(a), cos(w) cos(a), sin(w))        a azimuth, w vertical angle of the laser

With rpy_bs_deg = [-90, 0, 90] the azimuth 180 degrees looks down, 90 degrees to the right, and z backwards.

Position packet, port 8308, 512 bytes: 198 zeros; uint32 time [us] as above; uint8 pulse per second: 0 absent, 1
synchronising, 2 locked, 3 error; 3 zeros; the last GPRMC sentence, or zeros.  In the web page of the scanner both ports
can be set to one number, so that one link has both.

A data packet becomes a ``RangeScan`` of 384 points, a position packet a ``DeviceStatus``, which is ok when the pulse is
locked and the sentence valid.  Then a ``DeviceTime`` in UTC follows, and the following data packets are stamped in UTC;
otherwise with the time since power-on, of which the first hour is not known.

Not used: the heights of the lasers above the origin, at most 11 mm (table 9-1).  The Puck Hi-Res has other vertical
angles; packets of other products are refused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fti.drivers._no_commands import COMMANDS, command, on_connect, poll  # noqa: F401 - configured by its web page
from fti.drivers.velodyne_vlp16.options import Options

if TYPE_CHECKING:
    from fti.drivers.velodyne_vlp16.decoder import Decoder
    from fti.drivers.velodyne_vlp16.encoder import Encoder

DOCUMENT = "Velodyne VLP-16 User Manual, 63-9243 Rev. D, chapter 9"
MESSAGES = {
    "data": "ranges and reflectivities of 24 firings of 16 lasers",
    "position": "state of the pulse per second, GPRMC sentence",
}
CARRIERS = frozenset({"udp"})
SCANS = True


def make_decoder(options: Options) -> Decoder:
    """The decoder, which accepts every return mode."""
    from fti.drivers.velodyne_vlp16.decoder import Decoder  # noqa: PLC0415 - numpy: only where it decodes

    return Decoder()


def make_encoder(options: Options) -> Encoder:
    """The emulated scanner."""
    from fti.drivers.velodyne_vlp16.encoder import Encoder  # noqa: PLC0415 - see above

    return Encoder(options)


__all__ = ["CARRIERS", "COMMANDS", "DOCUMENT", "MESSAGES", "SCANS", "Options", "make_decoder", "make_encoder"]
