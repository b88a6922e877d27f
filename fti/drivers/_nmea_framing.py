"""Framing of NMEA 0183 sentences, for every line that carries them: alone, or between binary messages.

A sentence begins with $ or !, has printable characters, and ends with * and two hexadecimal digits, and LF or CR LF
(some receivers send CR CR LF).
"""

from __future__ import annotations

import re

from fti.drivers._framing import Skip
from fti.formats import nmea_fields as fields

#: The standard allows 82; receivers with more digits send up to about 100.
MAX_SENTENCE = 160

_BODY = re.compile(rb"[\x20\x22-\x23\x25-\x7e]*")
_END = re.compile(rb"\r{0,2}\n")
_OPEN_END = re.compile(rb"\r{0,2}\Z")


def measure_sentence(buffer: bytearray, bare: bool = False) -> int | Skip:
    """Size of the sentence at the start; up to its first invalid byte no other sentence can begin.

    bare : accept a sentence without asterisk and checksum
    """
    match = _BODY.match(buffer, 1)
    assert match is not None
    end = match.end()
    if end >= MAX_SENTENCE:
        return Skip(end, "too_long")
    if _OPEN_END.match(buffer, end):
        return 0
    line_end = _END.match(buffer, end)
    if line_end is None:
        return Skip(end, "bad_character")
    reason = _refusal_reason(buffer[1:end], bare)
    return Skip(end, reason) if reason else line_end.end()


def _refusal_reason(body: bytearray, bare: bool) -> str:
    """Reason why this is not a sentence, otherwise "".  body : between its start and the end of the line."""
    if b"*" not in body:
        return "" if bare and len(body) >= 6 else "no_checksum"
    if len(body) < 6 or body[-3] != ord("*"):
        return "no_checksum"
    return "" if b"%02X" % fields.checksum(body[:-3]) == body[-2:].upper() else "bad_checksum"


def split(frame: bytes) -> list[str]:
    """The fields of a sentence, the first with talker and formatter."""
    return frame[1:].partition(b"*")[0].rstrip(b"\r\n").decode("ascii").split(",")
