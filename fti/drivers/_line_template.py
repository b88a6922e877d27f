r"""A line of text described by a template, for reading and for writing.

    "0R2,Ta={static_air_temperature:.1f}{_ta_unit:1s},Pa={static_pressure:.1f}{_pa_unit:1s}"

    {name:.2f}  decimal number with just two decimals        {name:f}   with any number of decimals
    {name:d}    whole number                                 {name:g}   decimal number, perhaps with an exponent
    {name:x}    hexadecimal (X: capitals when written)       {name:s}   characters up to the text that follows
    {{ }}       braces; all other characters are literal

A width is the minimum number of characters, padded with spaces from the left, or with zeros ({n:07.2f}).  State the
width if the device sends a fixed one: it reveals a lost digit.  "+" before it always writes the sign.  For s and x a
width is the exact number of characters.

Advantages over a regular expression: the same template encodes the emulator's lines, so a round trip verifies it; and
matching takes linear time for any line, since fields never backtrack (atomic groups).
"""

from __future__ import annotations

import math
import re
import string
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from fti.formats.described_fields import WireValue

CHECKSUM = "checksum"
SPEC = re.compile(r"(\+?)(0?)(\d{0,2})(?:\.(\d))?([dfgsxX]?)")
NAME = re.compile(r"_?[a-z][a-z0-9_]{0,62}|_")
MAX_TEXT_LENGTH = 64


class TemplateField(NamedTuple):
    """A field in the template: text before it, name, format, kind and width."""

    before: str
    name: str
    spec: str
    kind: str
    width: int


class Template:
    """A compiled template.  Raises ValueError with the wrong field and the reason.

    lost : for each field the texts that mean "no measurement"
    """

    def __init__(self, text: str, lost: Mapping[str, Sequence[str]] | None = None) -> None:
        self.fields, self._after = _parse(text)
        self.names = [p.name for p in self.fields]
        for name in self.names:
            if self.names.count(name) > 1:
                raise ValueError(f"line: {name!r} occurs twice")
        texts = [*(p.before for p in self.fields), self._after][1:]
        self._lost = {
            name: {word.encode("latin-1", "replace") for word in words} for name, words in (lost or {}).items()
        }
        ends = [*map(re.escape, texts[:-1]), re.escape(texts[-1]) or r"\Z"] if texts else []
        groups = [
            _group(p, text, end, (lost or {}).get(p.name, ()))
            for p, text, end in zip(self.fields, texts, ends, strict=True)
        ]
        parts = [re.escape(p.before) + g for p, g in zip(self.fields, groups, strict=True)]
        self._pattern = re.compile(("".join(parts) + re.escape(self._after)).encode("latin-1"))
        self._widths = [(p.name, p.width) for p in self.fields if p.width]
        self._check_round_trip()

    @property
    def is_text(self) -> dict[str, bool]:
        """Fields of text."""
        return {p.name: p.kind == "s" for p in self.fields}

    def to_wire(self, name: str, word: float | str) -> float | str:
        """Decoded value of a word in the line.  Raises ValueError if the field cannot hold it."""
        field = next(p for p in self.fields if p.name == name)
        if isinstance(word, str):
            return _number(word, field.kind)
        if field.kind == "s":
            raise ValueError(f"{word:g} is a number, but the field is text: write it in quotes")
        if not _can_stand(field, word):
            raise ValueError(f"{word:.15g} does not fit into {{{name}:{field.spec}}}")
        return word

    def match(self, line: bytes) -> re.Match[bytes] | None:
        """The match of a whole line; None for another line."""
        match = self._pattern.fullmatch(line)
        if match is None or any(self._is_short(name, match[name], width) for name, width in self._widths):
            return None
        return match

    def _is_short(self, name: str, text: bytes, width: int) -> bool:
        return len(text) < width and text.strip() not in self._lost.get(name, ())

    def read(self, match: re.Match[bytes]) -> dict[str, WireValue]:
        """The values of the fields of a matched line."""
        return {p.name: _number(match[p.name].decode("latin-1"), p.kind) for p in self.fields}

    def write(self, values: Mapping[str, WireValue], checksum: Callable[[bytes], int] | None = None) -> bytes:
        """The line with these values; None is written as 0 or empty.  checksum : of the text before {checksum}."""
        line = ""
        for field in self.fields:
            line += field.before
            value = values.get(field.name)
            if field.name == CHECKSUM and checksum is not None:
                value = float(checksum(line.encode("latin-1", errors="replace")))
            line += _format_value(field, value)
        return (line + self._after).encode("latin-1", errors="replace")

    def _check_round_trip(self) -> None:
        """The template must decode its own lines: a field must differ from the text after it."""
        for number in (0.0, 12.0):
            sample: dict[str, WireValue] = {
                p.name: "a" * (p.width or 1) if p.kind == "s" else number for p in self.fields
            }
            match = self.match(self.write(sample))
            if match is None or self.read(match) != sample:
                raise ValueError("line: a field cannot be separated from the next one; put text between them")


def _parse(text: str) -> tuple[list[TemplateField], str]:
    fields: list[TemplateField] = []
    before = ""
    try:
        text.encode("latin-1")
        parts = list(string.Formatter().parse(text))
    except ValueError as error:  # UnicodeEncodeError is one
        raise ValueError(f"line: {error}") from None
    for literal, name, spec, conversion in parts:
        before += literal
        if name is None:
            continue
        fields.append(_make_field(before, name, spec or "", conversion))
        before = ""
    return fields, before


def _make_field(before: str, name: str, spec: str, conversion: str | None) -> TemplateField:
    if not NAME.fullmatch(name) or conversion:
        raise ValueError(f"line: {{{name}}}: a name has small letters, digits and _, and begins with a letter or _")
    match = SPEC.fullmatch(spec)
    if not match or (match[4] and match[5] not in ("f", "")) or (match[5] == "s" and (match[1] or match[2])):
        raise ValueError(f"line: {{{name}:{spec}}}: must be like f, .2f, 7.2f, 07.2f, g, d, 4d, x, 02X, s or 3s")
    kind = match[5] or "f"
    return TemplateField(before, name, spec if match[5] else f"{spec}f", kind, int(match[3] or 0))


def _group(field: TemplateField, follows: str, end: str, lost: Sequence[str]) -> str:
    """The pattern of a field; follows : the text after it, end : its pattern.

    A word for a lost signal may be the beginning of a number ("-"): it must be followed by the end.
    """
    fill = f" {{0,{field.width}}}" if field.width and field.kind in "dfg" else ""
    words = "".join(f"{fill}{re.escape(word)}(?={end})|" for word in lost)
    return f"(?P<{field.name}>(?>{words}{fill}{_core(field, follows)}))"


def _core(field: TemplateField, follows: str) -> str:
    """The pattern of a value that is not a word for a lost signal."""
    decimals = re.search(r"\.(\d)", field.spec)
    if field.kind == "s":
        stop = f"[^{re.escape(follows[0])}]" if follows else "."
        core = f".{{{field.width}}}" if field.width else f"{stop}{{0,{MAX_TEXT_LENGTH}}}"
    elif field.kind in "xX":
        core = f"[0-9A-Fa-f]{{{field.width or '1,16'}}}"
    elif field.kind == "d":
        core = r"[+-]?\d{1,18}"
    elif decimals:
        core = r"[+-]?\d{1,15}" + (rf"\.\d{{{decimals[1]}}}" if decimals[1] != "0" else "")
    else:
        core = r"[+-]?(?:\d{1,15}(?:\.\d{0,15})?|\.\d{1,15})"
        core += r"(?:[eE][+-]?\d{1,3})?" if field.kind == "g" else ""
    return core


def _can_stand(field: TemplateField, number: float) -> bool:
    """Can the field represent this number?"""
    if field.spec.endswith("g") or (field.kind == "f" and "." not in field.spec):
        return True
    text = _format_value(field, number).strip()
    return bool(re.fullmatch(_core(field, ""), text)) and _number(text, field.kind) == number


def _number(text: str, kind: str) -> float | str:
    """The value of the text of a field; a text that is not a number remains text."""
    if kind == "s":
        return text
    try:
        number = float(int(text, 16)) if kind in "xX" else float(text)
    except (ValueError, OverflowError):
        return text.strip()
    return number if math.isfinite(number) else text.strip()


def _format_value(field: TemplateField, value: WireValue) -> str:
    if isinstance(value, str) or field.kind == "s":
        return "" if value is None else str(value)
    number = value or 0.0
    return format(round(number), field.spec) if field.kind in "dxX" else format(number, field.spec)
