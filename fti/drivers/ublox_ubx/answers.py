"""Answers of a receiver: ACK-ACK, ACK-NAK, MON-VER."""

from __future__ import annotations

from fti.drivers.ublox_ubx.frames import frame
from fti.drivers.ublox_ubx.receiver_state import ReceiverState
from fti.drivers.ublox_ubx.table import CLASS_NAMES, NAMES
from fti.messages.measurements import Ack, Measurement, Stamp

SOFTWARE, HARDWARE, EXTENSION = 30, 10, 30
#: Command of a configuration message; CFG-VALSET may belong to several.
COMMAND_OF = {(0x06, 0x01): "message", (0x06, 0x08): "rate", (0x06, 0x04): "reset", (0x0A, 0x04): "version"}


def name_of(class_id: int, message_id: int) -> str:
    """The name of a message, or its numbers if unknown."""
    name = NAMES.get((class_id, message_id))
    return name or f"{CLASS_NAMES.get(class_id, f'0x{class_id:02X}')}-0x{message_id:02X}"


def read_ack(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """ACK-ACK."""
    return _answer(p, t_rx_ns, accepted=True)


def read_nak(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """ACK-NAK."""
    return _answer(p, t_rx_ns, accepted=False)


def _answer(p: bytes, t_rx_ns: int, accepted: bool) -> list[Measurement]:
    about = (p[0], p[1])
    command = COMMAND_OF.get(about, "")
    return [Ack(stamp=Stamp(t_rx_ns), command=command, accepted=accepted, detail=name_of(*about))]


def read_version(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """MON-VER: software, hardware, extensions; each a zero-padded text."""
    if len(p) < SOFTWARE + HARDWARE:
        raise ValueError("too short for MON-VER")
    ranges = [(0, SOFTWARE), (SOFTWARE, SOFTWARE + HARDWARE)]
    ranges += [(at, at + EXTENSION) for at in range(SOFTWARE + HARDWARE, len(p), EXTENSION)]
    texts = [p[a:b].partition(b"\x00")[0].decode("ascii", "replace").strip() for a, b in ranges]
    detail = "; ".join(text for text in texts if text)
    return [Ack(stamp=Stamp(t_rx_ns), command="version", accepted=True, detail=detail)]


def make_answer(accepted: bool, about: tuple[int, int]) -> bytes:
    """ACK-ACK or ACK-NAK."""
    return frame(0x05, int(accepted), bytes(about))


def make_version(detail: str) -> bytes:
    """MON-VER of "software; hardware; extension; ..."."""
    software, hardware, *extensions = [text.encode("ascii", "replace") for text in (detail + "; ").split("; ")]
    padded = [text[: EXTENSION - 1].ljust(EXTENSION, b"\x00") for text in extensions if text]
    head = software[: SOFTWARE - 1].ljust(SOFTWARE, b"\x00") + hardware[: HARDWARE - 1].ljust(HARDWARE, b"\x00")
    return frame(0x0A, 0x04, head + b"".join(padded))
