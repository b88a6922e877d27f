"""A checksum for the metadata of a file: MCAP has one for chunks, attachments and the summary, and none for these.

The main table of a file holds the checksum of every other one, as it stands in the file, and of itself without that.
It is written behind the others: a file that breaks off between its tables is one whose tables are not sealed yet.
"""

from __future__ import annotations

import zlib
from collections.abc import Collection, Mapping

from fti.logger import records

CHECKSUM_KEY = "crc32"


def with_checksums(main: str, tables: Mapping[str, Mapping[str, str]]) -> dict[str, dict[str, str]]:
    """The tables in the order in which they are to be written.  main : name of the one with the checksums, the last."""
    others = {name: dict(table) for name, table in tables.items() if name != main}
    about = {**tables[main], **{f"{CHECKSUM_KEY}_{name}": _sum_of(name, table) for name, table in others.items()}}
    return {**others, main: {**about, CHECKSUM_KEY: _sum_of(main, about)}}


def changed_tables(main: str, tables: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Names of the tables that are not as they were sealed; none where nothing is sealed."""
    if main not in tables:
        return [name for name, table in tables.items() if CHECKSUM_KEY in table]  # its name is not as it was
    about = tables[main]
    if not any(key.startswith(CHECKSUM_KEY) for key in about):
        return []
    own = {key: value for key, value in about.items() if key != CHECKSUM_KEY}
    wrong = [main] if about.get(CHECKSUM_KEY) != _sum_of(main, own) else []
    for key, told in own.items():
        name = key.removeprefix(f"{CHECKSUM_KEY}_")
        if name != key and told != _sum_of(name, tables.get(name, {})):
            wrong.append(name)
    return wrong


def with_own_checksum(name: str, table: Mapping[str, str]) -> dict[str, str]:
    """A table that is added later than the others, with its own checksum."""
    return {**table, CHECKSUM_KEY: _sum_of(name, table)}


def all_changed_tables(main: str, tables: Mapping[str, Mapping[str, str]], later: Collection[str]) -> list[str]:
    """Names of the tables that are not as they were written; later : those that are self-sealed."""
    covered_tables = {name: table for name, table in tables.items() if name not in later}
    return [
        *changed_tables(main, covered_tables),
        *(name for name in later if name in tables and not is_intact(name, tables[name])),
    ]


def is_intact(name: str, table: Mapping[str, str]) -> bool:
    """Is a self-sealed table as it was written?  One without a checksum was written by fti 0.1."""
    own = {key: value for key, value in table.items() if key != CHECKSUM_KEY}
    return CHECKSUM_KEY not in table or table[CHECKSUM_KEY] == _sum_of(name, own)


def _sum_of(name: str, table: Mapping[str, str]) -> str:
    return f"{zlib.crc32(records.metadata(name, table)):08x}"
