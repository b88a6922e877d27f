"""SYSSTAT 0x19: the system status; its mode selects the words.

    0 mode u32 | 4 system status u32 | then, for each bit of the mode, lowest first:
    bit 0 IMU u32 | 1 GNSS u32 | 2 magnetometer u32 | 3 air-data computer u32 | 4 filter low u32, high u32
    5 filter, general u32 | 6 additional 4 x u32 | 7 service u32 | 8 remaining alignment time f [s]
    9 second system word u32

Every bit that is set becomes a flag of DeviceStatus, by its name (see ``status``).  Overranges, an invalid
calibration and filter errors (bits 4-11, 18) remain set until the next alignment.
"""

from __future__ import annotations

import struct

from fti.drivers.imar_ixcom import status
from fti.drivers.imar_ixcom.decoder_state import DecoderState
from fti.drivers.imar_ixcom.encoder_state import EncoderState
from fti.drivers.imar_ixcom.generic_values import GenericValue, decode_generic_values, nan_if_none
from fti.drivers.imar_ixcom.wire import IxcomFrame
from fti.messages.measurements import Measurement

WORD = struct.Struct("<I")
SECONDS = struct.Struct("<f")
REMAINING = GenericValue("remaining_align_time", "s")
REMAINING_BIT = 8
#: The words that each bit of the mode adds; none: a time.
WORDS: tuple[tuple[status.Names, ...], ...] = (
    (status.word_names("imu_status"),),
    (status.GNSS,),
    (status.word_names("magnetometer_status"),),
    (status.word_names("madc_status"),),
    (status.EKF_LOW, status.EKF_HIGH),
    (status.word_names("ekf_general"),),
    tuple(status.word_names(f"additional_{i}") for i in range(4)),
    (status.word_names("service"),),
    (),
    (status.SYSTEM_2,),
)
MIN_PAYLOAD_BYTES = 2 * WORD.size


def decode_sysstat(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement] | None:
    """The remaining alignment time; the status with all the words.  None if the length does not fit the mode."""
    mode = WORD.unpack_from(frame.payload)[0]
    if mode >> len(WORDS) or len(frame.payload) != _length(mode):
        return None
    flags = status.decode_word(WORD.unpack_from(frame.payload, WORD.size)[0], status.SYSTEM)
    measurements: list[Measurement] = []
    at = MIN_PAYLOAD_BYTES
    for bit, words in enumerate(WORDS):
        if mode >> bit & 1:
            for names in words:
                flags += status.decode_word(WORD.unpack_from(frame.payload, at)[0], names)
                at += WORD.size
            if bit == REMAINING_BIT:
                measurements += decode_generic_values(frame.stamp, [REMAINING], SECONDS.unpack_from(frame.payload, at))
                at += SECONDS.size
    decoder_state.set_status_words("SYSSTAT", frame.stamp, flags)
    return measurements + decoder_state.status(frame, always=True)


def _length(mode: int) -> int:
    return MIN_PAYLOAD_BYTES + sum(WORD.size * max(len(words), 1) for bit, words in enumerate(WORDS) if mode >> bit & 1)


def encode_sysstat(encoder_state: EncoderState) -> bytes:
    """Payload with the words in which a flag is set, and the alignment time if known."""
    mode, body = 0, b""
    for bit, words in enumerate(WORDS):
        values = [status.encode_word(encoder_state.flags, names) for names in words]
        if any(values):
            mode, body = mode | 1 << bit, body + b"".join(map(WORD.pack, values))
        elif bit == REMAINING_BIT and REMAINING.name in encoder_state.readings:
            mode, body = mode | 1 << bit, body + SECONDS.pack(nan_if_none(encoder_state.readings[REMAINING.name]))
    return WORD.pack(mode) + WORD.pack(status.encode_word(encoder_state.flags, status.SYSTEM)) + body
