"""Framing of NMEA 0183 sentences, for every line that carries them: alone, or between binary messages.

A sentence begins with $ or !, has printable characters, and ends with * and two hexadecimal digits, and LF or CR LF
(some receivers send CR CR LF).
"""

from __future__ import annotations

import re

from fti.drivers import _nmea_fields as fields
from fti.drivers._framing import Skip

#: The standard says 82; receivers with more digits send up to about 100.
MAX_SENTENCE = 160

_BODY = re.compile(rb"[\x20\x22-\x23\x25-\x7e]*")
_END = re.compile(rb"\r{0,2}\n")
_OPEN_END = re.compile(rb"\r{0,2}\Z")


def measure_sentence(buffer: bytearray, bare: bool = False) -> int | Skip:
    """A sentence that begins here; nothing up to its first strange byte can be the start of another.

    bare : a sentence without asterisk and checksum is one, too
    """
    found = _BODY.match(buffer, 1)
    assert found is not None
    end = found.end()
    if end >= MAX_SENTENCE:
        return Skip(end, "too_long")
    if _OPEN_END.match(buffer, end):
        return 0
    line_end = _END.match(buffer, end)
    if line_end is None:
        return Skip(end, "bad_character")
    reason = _refused(buffer[1:end], bare)
    return Skip(end, reason) if reason else line_end.end()


def _refused(body: bytearray, bare: bool) -> str:
    """Why this is no sentence; "" when it is one.  body : between its start and the end of the line."""
    if b"*" not in body:
        return "" if bare and len(body) >= 6 else "no_checksum"
    if len(body) < 6 or body[-3] != ord("*"):
        return "no_checksum"
    return "" if b"%02X" % fields.checksum(body[:-3]) == body[-2:].upper() else "bad_checksum"


def split(frame: bytes) -> list[str]:
    """The fields of a sentence, the first with talker and formatter."""
    return frame[1:].partition(b"*")[0].rstrip(b"\r\n").decode("ascii").split(",")
