"""Checksums of the metadata tables of a file: MCAP has checksums for chunks, attachments and the summary only.

The main table holds the checksum of every other table and of itself without that entry.  It is written last: a file
that ends between its tables has no checksums yet.
"""

from __future__ import annotations

import zlib
from collections.abc import Collection, Mapping

from fti.logger import records

CHECKSUM_KEY = "crc32"


def with_checksums(main: str, tables: Mapping[str, Mapping[str, str]]) -> dict[str, dict[str, str]]:
    """The tables in the order of writing.  main : name of the table with the checksums, the last one."""
    others = {name: dict(table) for name, table in tables.items() if name != main}
    main_table = {**tables[main], **{f"{CHECKSUM_KEY}_{name}": _sum_of(name, table) for name, table in others.items()}}
    return {**others, main: {**main_table, CHECKSUM_KEY: _sum_of(main, main_table)}}


def changed_tables(main: str, tables: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Names of the tables that do not match their checksums; none without checksums."""
    if main not in tables:
        return [name for name, table in tables.items() if CHECKSUM_KEY in table]  # its name was changed
    main_table = tables[main]
    if not any(key.startswith(CHECKSUM_KEY) for key in main_table):
        return []
    own = {key: value for key, value in main_table.items() if key != CHECKSUM_KEY}
    changed = [main] if main_table.get(CHECKSUM_KEY) != _sum_of(main, own) else []
    for key, stated in own.items():
        name = key.removeprefix(f"{CHECKSUM_KEY}_")
        if name != key and stated != _sum_of(name, tables.get(name, {})):
            changed.append(name)
    return changed


def with_own_checksum(name: str, table: Mapping[str, str]) -> dict[str, str]:
    """A table that is added later, with its own checksum."""
    return {**table, CHECKSUM_KEY: _sum_of(name, table)}


def all_changed_tables(main: str, tables: Mapping[str, Mapping[str, str]], later: Collection[str]) -> list[str]:
    """Names of the tables that do not match their checksums; later : tables with their own checksum."""
    covered_tables = {name: table for name, table in tables.items() if name not in later}
    return [
        *changed_tables(main, covered_tables),
        *(name for name in later if name in tables and not is_intact(name, tables[name])),
    ]


def is_intact(name: str, table: Mapping[str, str]) -> bool:
    """Does a table match its own checksum?  One without a checksum was written by fti 0.1."""
    own = {key: value for key, value in table.items() if key != CHECKSUM_KEY}
    return CHECKSUM_KEY not in table or table[CHECKSUM_KEY] == _sum_of(name, own)


def _sum_of(name: str, table: Mapping[str, str]) -> str:
    return f"{zlib.crc32(records.metadata(name, table)):08x}"
