"""Error frames of a CAN controller, counted by class.

Source: Linux ``include/uapi/linux/can/error.h``.  The identifier of an error frame is a set of classes; byte 1 of its
data says more of a problem of the controller itself.  One frame may tell of several.  The frames are recorded as they
come; the counts stand in the ledger and can be made again from the file.

``can_rx_overflow`` tells that the controller lost frames, not how many: nobody knows.
"""

from __future__ import annotations

from fti import canframe

#: Bit of the identifier -> class.
CLASSES = {
    0x001: "can_tx_timeout",
    0x002: "can_arbitration_lost",
    0x008: "can_protocol",
    0x010: "can_transceiver",
    0x020: "can_no_ack",
    0x040: "can_bus_off",
    0x080: "can_bus_error",
    0x100: "can_restarted",
}
CONTROLLER = 0x004
#: Bits of byte 1 of the data -> what the controller says.
CONTROLLER_CLASSES = {
    0x01: "can_rx_overflow",
    0x02: "can_tx_overflow",
    0x0C: "can_error_warning",
    0x30: "can_error_passive",
    0x40: "can_error_active",
}
TOTAL = "can_error_frames"
_FLAG = canframe.ERROR >> 24  # in byte 3 of a frame


def is_error(frame: bytes) -> bool:
    """Is this an error frame?"""
    return bool(frame[3] & _FLAG)


def classes_of(frame: bytes) -> list[str]:
    """The classes that an error frame tells of."""
    word = int.from_bytes(frame[:4], "little")
    found = [name for bit, name in CLASSES.items() if word & bit]
    if word & CONTROLLER:
        found += [name for bits, name in CONTROLLER_CLASSES.items() if frame[9] & bits]
    return found


def count_error(errors: dict[str, int], frame: bytes) -> None:
    """Count an error frame in the errors of a link."""
    for name in (TOTAL, *classes_of(frame)):
        errors[name] = errors.get(name, 0) + 1
