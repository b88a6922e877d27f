"""Error frames of a CAN controller, counted by class.

Source: Linux ``include/uapi/linux/can/error.h``.  The identifier of an error frame is a set of classes; byte 1 of its
data details a problem of the controller.  One frame may contain several classes.  The frames are recorded unchanged;
the counts are in the ledger and can be recomputed from the file.

``can_rx_overflow`` reports that the controller lost frames, not how many; ``can_rx_over_errors`` is the counter of the
driver of a SocketCAN interface (Linux, ``Documentation/ABI/testing/sysfs-class-net-statistics``), if it has one.
"""

from __future__ import annotations

from pathlib import Path

from fti import canframe
from fti.constants import SECOND_NS

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
#: Bits of byte 1 of the data -> state of the controller.
CONTROLLER_CLASSES = {
    0x01: "can_rx_overflow",
    0x02: "can_tx_overflow",
    0x0C: "can_error_warning",
    0x30: "can_error_passive",
    0x40: "can_error_active",
}
TOTAL = "can_error_frames"
OVER_ERRORS = "can_rx_over_errors"
_FLAG = canframe.ERROR >> 24  # in byte 3 of a frame


def is_error(frame: bytes) -> bool:
    """Is this an error frame?"""
    return bool(frame[3] & _FLAG)


def classes_of(frame: bytes) -> list[str]:
    """The classes in an error frame."""
    word = int.from_bytes(frame[:4], "little")
    classes = [name for bit, name in CLASSES.items() if word & bit]
    if word & CONTROLLER:
        classes += [name for bits, name in CONTROLLER_CLASSES.items() if frame[9] & bits]
    return classes


def count_error(errors: dict[str, int], frame: bytes) -> None:
    """Count an error frame in the errors of a link."""
    for name in (TOTAL, *classes_of(frame)):
        errors[name] = errors.get(name, 0) + 1


class ControllerWatch:
    """Adds the losses of a controller as counted by its driver, once a second, over all connections."""

    def __init__(self, errors: dict[str, int], interface: str, root: Path = Path("/sys/class/net")) -> None:
        self._errors = errors
        self._path = root / interface / "statistics" / "rx_over_errors"
        self._last: int | None = None
        self._due_ns = 0

    def begin(self, now_ns: int) -> None:
        """The interface was opened: earlier counts are the baseline."""
        self._last = self._read()
        self._due_ns = now_ns + SECOND_NS
        if self._last is not None:
            self._errors.setdefault(OVER_ERRORS, 0)

    def read_if_due(self, now_ns: int) -> None:
        """Read when a second has passed."""
        if now_ns >= self._due_ns:
            self._due_ns = now_ns + SECOND_NS
            self.read()

    def read(self) -> None:
        """Read now, before the interface is closed.  A smaller value means that the counter was reset."""
        count = self._read()
        if count is not None and self._last is not None:
            self._errors[OVER_ERRORS] += count - self._last if count >= self._last else count
            self._last = count

    def _read(self) -> int | None:
        try:
            return int(self._path.read_text())
        except (OSError, ValueError):
            return None
