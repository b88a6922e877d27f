"""Columns of text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence


def text_table(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Lines with aligned columns; repeated cells of the first column are left out."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    last = ""
    for row in rows:
        first = "" if row[0] == last else row[0]
        last = row[0]
        yield "  ".join(cell.ljust(width) for cell, width in zip((first, *row[1:]), widths, strict=True)).rstrip()
