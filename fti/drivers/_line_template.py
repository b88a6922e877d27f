r"""A line of text described by a template, for reading and for writing.

    "0R2,Ta={static_air_temperature:.1f}{_ta_unit:1s},Pa={static_pressure:.1f}{_pa_unit:1s}"

    {name:.2f}  decimal number with just two decimals        {name:f}   with any number of decimals
    {name:d}    whole number                                 {name:g}   decimal number, perhaps with an exponent
    {name:x}    hexadecimal (X: capitals when written)       {name:s}   characters up to the text that follows
    {{ }}       braces; everything else stands for itself

A width is the least number of characters, filled with spaces from the left, or with zeros ({n:07.2f}): where the
device sends a fixed width, say it, for it shows a lost digit.  "+" before it writes the sign always.  For s and x a
width is the exact number of characters.

Why no regular expression: the same text also makes the emulator's lines, so a round trip proves it; and matching
takes time in proportion to the line, whatever stands in it, since no field ever gives back a character (atomic
groups).
"""

from __future__ import annotations

import math
import re
import string
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from fti.drivers._fields import WireValue

CHECKSUM = "checksum"
SPEC = re.compile(r"(\+?)(0?)(\d{0,2})(?:\.(\d))?([dfgsxX]?)")
NAME = re.compile(r"_?[a-z][a-z0-9_]{0,62}|_")
MAX_TEXT_LENGTH = 64


class TemplateField(NamedTuple):
    """A field in the template: the text before it, its name, how it is written, its kind and width."""

    before: str
    name: str
    spec: str
    kind: str
    width: int


class Template:
    """A compiled template.  Raises ValueError that says which field is wrong, and why.

    lost : for each field the characters that stand for "no measurement"
    """

    def __init__(self, text: str, lost: Mapping[str, Sequence[str]] | None = None) -> None:
        self.places, self._after = _parse(text)
        self.names = [p.name for p in self.places]
        for name in self.names:
            if self.names.count(name) > 1:
                raise ValueError(f"line: {name!r} stands there twice")
        texts = [*(p.before for p in self.places), self._after][1:]
        self._lost = {
            name: {word.encode("latin-1", "replace") for word in words} for name, words in (lost or {}).items()
        }
        ends = [*map(re.escape, texts[:-1]), re.escape(texts[-1]) or r"\Z"] if texts else []
        groups = [
            _group(p, text, end, (lost or {}).get(p.name, ()))
            for p, text, end in zip(self.places, texts, ends, strict=True)
        ]
        parts = [re.escape(p.before) + g for p, g in zip(self.places, groups, strict=True)]
        self._pattern = re.compile(("".join(parts) + re.escape(self._after)).encode("latin-1"))
        self._widths = [(p.name, p.width) for p in self.places if p.width]
        self._check_round_trip()

    @property
    def is_text(self) -> dict[str, bool]:
        """Which fields are characters."""
        return {p.name: p.kind == "s" for p in self.places}

    def to_wire(self, name: str, word: float | str) -> float | str:
        """What a field says where this stands in the line.  Raises ValueError where it cannot stand there."""
        place = next(p for p in self.places if p.name == name)
        if isinstance(word, str):
            return _number(word, place.kind)
        if place.kind == "s":
            raise ValueError(f"{word:g} is a number, and the field has characters: write it in quotes")
        if not _can_stand(place, word):
            raise ValueError(f"{word:.15g} cannot stand in {{{name}:{place.spec}}}")
        return word

    def match(self, line: bytes) -> re.Match[bytes] | None:
        """The match of a whole line; None when it is another line."""
        found = self._pattern.fullmatch(line)
        if found is None or any(self._is_short(name, found[name], width) for name, width in self._widths):
            return None
        return found

    def _is_short(self, name: str, text: bytes, width: int) -> bool:
        return len(text) < width and text.strip() not in self._lost.get(name, ())

    def read(self, found: re.Match[bytes]) -> dict[str, WireValue]:
        """What each field of a matched line says."""
        return {p.name: _number(found[p.name].decode("latin-1"), p.kind) for p in self.places}

    def write(self, values: Mapping[str, WireValue], checksum: Callable[[bytes], int] | None = None) -> bytes:
        """The line of these values; one that is None is 0 or empty.  checksum : of what stands before {checksum}."""
        line = ""
        for place in self.places:
            line += place.before
            value = values.get(place.name)
            if place.name == CHECKSUM and checksum is not None:
                value = float(checksum(line.encode("latin-1", errors="replace")))
            line += _format_value(place, value)
        return (line + self._after).encode("latin-1", errors="replace")

    def _check_round_trip(self) -> None:
        """A field must be told from what follows it: the template must read what it writes."""
        for number in (0.0, 12.0):
            sample: dict[str, WireValue] = {
                p.name: "a" * (p.width or 1) if p.kind == "s" else number for p in self.places
            }
            found = self.match(self.write(sample))
            if found is None or self.read(found) != sample:
                raise ValueError("line: a field cannot be told from what follows it; text must stand between them")


def _parse(text: str) -> tuple[list[TemplateField], str]:
    places: list[TemplateField] = []
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
        places.append(_make_field(before, name, spec or "", conversion))
        before = ""
    return places, before


def _make_field(before: str, name: str, spec: str, conversion: str | None) -> TemplateField:
    if not NAME.fullmatch(name) or conversion:
        raise ValueError(f"line: {{{name}}}: a name has small letters, digits and _, and begins with a letter or _")
    found = SPEC.fullmatch(spec)
    if not found or (found[4] and found[5] not in ("f", "")) or (found[5] == "s" and (found[1] or found[2])):
        raise ValueError(f"line: {{{name}:{spec}}}: must be like f, .2f, 7.2f, 07.2f, g, d, 4d, x, 02X, s or 3s")
    kind = found[5] or "f"
    return TemplateField(before, name, spec if found[5] else f"{spec}f", kind, int(found[3] or 0))


def _group(place: TemplateField, follows: str, end: str, lost: Sequence[str]) -> str:
    """The pattern of a field; follows : the text behind it, end : its pattern.

    A word for a lost signal may be the beginning of a number ("-"): it is one only where its end is.
    """
    fill = f" {{0,{place.width}}}" if place.width and place.kind in "dfg" else ""
    words = "".join(f"{fill}{re.escape(word)}(?={end})|" for word in lost)
    return f"(?P<{place.name}>(?>{words}{fill}{_core(place, follows)}))"


def _core(place: TemplateField, follows: str) -> str:
    """The pattern of what is no word for a lost signal."""
    decimals = re.search(r"\.(\d)", place.spec)
    if place.kind == "s":
        stop = f"[^{re.escape(follows[0])}]" if follows else "."
        core = f".{{{place.width}}}" if place.width else f"{stop}{{0,{MAX_TEXT_LENGTH}}}"
    elif place.kind in "xX":
        core = f"[0-9A-Fa-f]{{{place.width or '1,16'}}}"
    elif place.kind == "d":
        core = r"[+-]?\d{1,18}"
    elif decimals:
        core = r"[+-]?\d{1,15}" + (rf"\.\d{{{decimals[1]}}}" if decimals[1] != "0" else "")
    else:
        core = r"[+-]?(?:\d{1,15}(?:\.\d{0,15})?|\.\d{1,15})"
        core += r"(?:[eE][+-]?\d{1,3})?" if place.kind == "g" else ""
    return core


def _can_stand(place: TemplateField, number: float) -> bool:
    """Is a number one that a line may have at a place?"""
    if place.spec.endswith("g") or (place.kind == "f" and "." not in place.spec):
        return True
    text = _format_value(place, number).strip()
    return bool(re.fullmatch(_core(place, ""), text)) and _number(text, place.kind) == number


def _number(text: str, kind: str) -> float | str:
    """What the characters of a field say; those that are no number stand for themselves."""
    if kind == "s":
        return text
    try:
        number = float(int(text, 16)) if kind in "xX" else float(text)
    except (ValueError, OverflowError):
        return text.strip()
    return number if math.isfinite(number) else text.strip()


def _format_value(place: TemplateField, value: WireValue) -> str:
    if isinstance(value, str) or place.kind == "s":
        return "" if value is None else str(value)
    number = value or 0.0
    return format(round(number), place.spec) if place.kind in "dxX" else format(number, place.spec)
