"""Parses TOML texts, also untrusted ones, within limits of size, depth and integers."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from typing import Any

from fti.errors import ConfigError

#: A configuration of 200 links has about 100 kB.
MAX_TOML_BYTES = 4 * 2**20
#: Depth of nested tables and arrays; a configuration has 5.
MAX_TOML_DEPTH = 32
_LONG_KEY = re.compile(rf"""(?<![\w"'-])[\w"'-]++(?:\s*+\.\s*+[\w"'-]++){{{MAX_TOML_DEPTH}}}""")
_MIN_INTEGER, _MAX_INTEGER = -(2**63), 2**63 - 1


def decode_text(data: bytes, file: str) -> str:
    """The text of a file or an attachment, UTF-8.  Raises ConfigError."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        raise ConfigError(f"{file}: is not UTF-8 text") from None


def parse_toml(text: str, file: str) -> dict[str, Any]:
    """The table in a TOML text; file : its name, for the message.  Raises ConfigError."""
    if len(text) > MAX_TOML_BYTES:
        raise ConfigError(f"{file}: is longer than {MAX_TOML_BYTES} bytes")
    if _LONG_KEY.search(text):  # tomllib would store every prefix of the key
        raise ConfigError(f"{file}: a key has more than {MAX_TOML_DEPTH} parts")
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # from tomllib, or from a number or a nesting that Python refuses
        raise ConfigError(f"{file}: is not valid TOML: {error}") from None
    for depth, key, value in _values(table):
        if depth > MAX_TOML_DEPTH:
            raise ConfigError(f"{file}: {key}: tables are nested deeper than {MAX_TOML_DEPTH}")
        if isinstance(value, int) and not _MIN_INTEGER <= value <= _MAX_INTEGER:
            raise ConfigError(f"{file}: {key}: the number does not fit into 64 bits")
    return table


def _values(table: dict[str, Any]) -> Iterator[tuple[int, str, Any]]:
    """Every value with its depth and its top-level key; without recursion."""
    pending = [(1, key, value) for key, value in table.items()]
    while pending:
        depth, key, value = pending.pop()
        yield depth, key, value
        inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
        pending += [(depth + 1, key, each) for each in inner]
