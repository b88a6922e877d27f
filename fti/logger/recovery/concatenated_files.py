"""Files that were joined into one, as ``cat`` does: where each of them begins."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from fti.logger.reading.record_validation import record_end
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import MAGIC, Op

BLOCK_BYTES = 4 * 2**20
#: Places that may begin a file and are looked at behind a damage; recordings inside messages are such places.
MAX_TRIES = 1000


def file_begins(source: TolerantFile) -> list[int]:
    """Where the joined files begin; [0] for a single one.

    Behind a file that is whole the next one begins with its magic.  In one that is not, another begins where sound
    records lead from a magic to the end or to the begin of a further one; a recording in a message does not lead there.
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
    """Do magic and a header stand here?"""
    return source.read(at, len(MAGIC) + 1) == MAGIC + bytes([Op.HEADER])


def _end_of_file(source: TolerantFile, begin: int) -> tuple[int, bool]:
    """The end of a file, and True; where it is damaged or ends without a footer, that place and False."""
    at = begin + len(MAGIC)
    while at < source.size:
        op, end = source.read(at, 1)[0], record_end(source, at, source.size)
        if end is None:
            break
        if op == Op.FOOTER and source.read(end, len(MAGIC)) == MAGIC:
            return end + len(MAGIC), True
        at = end
    return at, False


def _next_begin(source: TolerantFile, at: int) -> int | None:
    for place in islice(_places(source, at), MAX_TRIES):
        end, whole = _end_of_file(source, place)
        if whole and (end == source.size or _begins(source, end)):
            return place
    return None


def _places(source: TolerantFile, at: int) -> Iterator[int]:
    """Where magic and the opcode of a header stand, from a position on."""
    mark = MAGIC + bytes([Op.HEADER])
    while at < source.size:
        block = source.read(at, BLOCK_BYTES + len(mark) - 1)
        found = block.find(mark)
        while found >= 0:
            yield at + found
            found = block.find(mark, found + 1)
        at += BLOCK_BYTES
