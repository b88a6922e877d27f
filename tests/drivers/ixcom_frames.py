"""Frames of iXCOM encoded by the maker's package, and their decoding by a new decoder."""

from __future__ import annotations

from typing import Any

import ixcom.data

from fti.drivers import imar_ixcom as ix
from fti.drivers.imar_ixcom.options import NUMBERS
from fti.messages.measurements import Measurement, Reading

GOOD = 0xB400
INSSOL: dict[str, Any] = {
    "rpy": [0.1, -0.05, 2.5],
    "vel": [60.0, -10.0, 3.0],
    "lon": 0.2,
    "lat": 0.84,
    "alt": 500.0,
    "DatSel": 0x048A,
}
GNSS: dict[str, Any] = {
    "lon": 0.2,
    "lat": 0.84,
    "alt": 452.75,
    "undulation": 47.25,
    "velNED": [60.0, -10.0, 3.0],
    "posType": 16,
}


def frame(name: str, **content: Any) -> bytes:
    """A message as the maker's package writes it.  footer : the status word; varsize : the mode of SYSSTAT."""
    message = ixcom.data.getMessageWithID(NUMBERS[name], content.pop("varsize", None))
    message.header.msgID, message.header.week = NUMBERS[name], 2300
    message.bottom.gStatus = content.pop("footer", GOOD)
    assert set(content) <= set(message.payload.data)
    message.payload.data.update(content)
    return bytes(message.to_bytes())


def decode(*data: bytes, **options: Any) -> list[Measurement]:
    """What a fresh decoder makes of frames that come a nanosecond apart."""
    decoder = ix.make_decoder(ix.Options(**options))
    return [m for i, one in enumerate(data) for m in decoder.feed(one, i)]


def only(kind: type, measurements: list[Measurement]) -> Any:
    """The one measurement of a class."""
    (one,) = (m for m in measurements if isinstance(m, kind))
    return one


def readings(measurements: list[Measurement]) -> dict[str, float | None]:
    """The values of the Readings, by name."""
    return {m.name: m.value for m in measurements if isinstance(m, Reading)}
