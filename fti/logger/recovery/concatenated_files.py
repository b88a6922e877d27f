"""Search for the begins of files that were concatenated, for example by ``cat``."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from fti.logger.reading.record_validation import valid_records
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import MAGIC, Op

BLOCK_BYTES = 4 * 2**20
#: Number of possible begins that are tried after damage; recordings inside messages look like begins too.
MAX_TRIES = 1000


def file_begins(source: TolerantFile) -> list[int]:
    """Offsets of the concatenated files; [0] for a single one.

    After a complete file the next one begins with its magic.  In a damaged file, another one begins where valid records
    lead from a magic to the end or to a further begin; the records of a recording inside a message do not.
    """
    begins = [0]
    while begins[-1] < source.size:
        end, whole = _end_of_file(source, begins[-1])
        following = end if whole else _next_begin(source, begins[-1] + len(MAGIC))
        if following is None or following >= source.size or not _begins(source, following):
            break
        begins.append(following)
    return begins


def _begins(source: TolerantFile, at: int) -> bool:
    return source.read(at, len(MAGIC) + 1) == MAGIC + bytes([Op.HEADER])


def _end_of_file(source: TolerantFile, begin: int) -> tuple[int, bool]:
    """End of a file and True; for a damaged or unfinished file the end of its valid records and False."""
    end = begin + len(MAGIC)
    for op, _, end in valid_records(source, begin + len(MAGIC), source.size):
        if op == Op.FOOTER and source.read(end, len(MAGIC)) == MAGIC:
            return end + len(MAGIC), True
    return end, False


def _next_begin(source: TolerantFile, at: int) -> int | None:
    for offset in islice(_header_offsets(source, at), MAX_TRIES):
        end, whole = _end_of_file(source, offset)
        if whole and (end == source.size or _begins(source, end)):
            return offset
    return None


def _header_offsets(source: TolerantFile, at: int) -> Iterator[int]:
    """Offsets of magic and the opcode of a header, from a position on."""
    mark = MAGIC + bytes([Op.HEADER])
    while at < source.size:
        block = source.read(at, BLOCK_BYTES + len(mark) - 1)
        found = block.find(mark)
        while found >= 0:
            yield at + found
            found = block.find(mark, found + 1)
        at += BLOCK_BYTES
