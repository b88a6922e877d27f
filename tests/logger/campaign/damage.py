"""What befalls an open file: flipped bits, zeroed pages, cuts, power cuts; each place at random or aimed."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import NamedTuple

from tests.logger.campaign.mcap_parser import (
    ATTACHMENT,
    CHANNEL,
    CHECKPOINTS,
    CHUNK,
    CHUNK_HEAD_BYTES,
    MAGIC,
    MESSAGE,
    MESSAGE_INDEX,
    METADATA,
    RECORD_HEAD_BYTES,
    SCHEMA,
    Record,
)
from tests.logger.campaign.open_sessions import PAGE, SECOND_NS, OpenSession

MESSAGE_HEAD_BYTES = RECORD_HEAD_BYTES + 22


class DamagedFile(NamedTuple):
    """The bytes of the open file after it, and where it was hit.

    natural : a kill or a power cut may leave it; twice : may look like a power cut before the last sync had ended
    """

    data: bytes
    place: str
    natural: bool = False
    twice: bool = False


DamageFunction = Callable[[OpenSession, Random], DamagedFile]


def _flip(session: OpenSession, chance: Random, spans: list[tuple[int, int]]) -> DamagedFile:
    """Flip one bit in one of some spans; anywhere when there is none."""
    begin, end = chance.choice(spans) if spans else (0, len(session.data))
    at, bit = chance.randrange(begin, end), chance.randrange(8)
    data = bytearray(session.data)
    data[at] ^= 1 << bit
    return DamagedFile(bytes(data), f"bit {bit} of byte {at}")


def _heads(records: list[Record], size: int = RECORD_HEAD_BYTES) -> list[tuple[int, int]]:
    return [(record.begin, min(record.begin + size, record.end)) for record in records]


def _spans(records: list[Record]) -> list[tuple[int, int]]:
    return [(record.begin, record.end) for record in records]


def _open_chunk(session: OpenSession) -> list[Record]:
    """Records of the last chunk."""
    chunks = session.parsed.of(CHUNK)
    return [record for record in session.parsed.records if chunks and record.chunk == chunks[-1].begin]


def _last_second(session: OpenSession) -> list[tuple[int, int]]:
    end_ns = max((message.content.log_time for message in session.parsed.messages), default=0)
    late = [m for m in session.parsed.messages if m.content.log_time > end_ns - SECOND_NS]
    return [(message.begin, message.end) for message in late]


def _anywhere(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, [])


def _in_file_head(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, [(0, len(MAGIC) + 23)])


def _in_message_length(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, [(r.begin + 1, r.begin + 4) for r in session.parsed.of(MESSAGE)])


def _in_message_head(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, _heads(session.parsed.of(MESSAGE), MESSAGE_HEAD_BYTES))


def _in_open_chunk(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, _spans(_open_chunk(session)))


def _in_last_second(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, _last_second(session))


def _in_chunk_head(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, _heads(session.parsed.of(CHUNK), CHUNK_HEAD_BYTES))


def _in_last_chunk_head(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, _heads(session.parsed.of(CHUNK)[-1:], CHUNK_HEAD_BYTES))


def _in_checkpoints(session: OpenSession, chance: Random) -> DamagedFile:
    """The filled slots of the last one, and heads."""
    records = session.parsed.of(CHECKPOINTS)
    filled = [
        (at, at + 1)
        for record in records[-1:]
        for at in range(record.begin, record.end)
        if session.data[at] or at < record.begin + RECORD_HEAD_BYTES
    ]
    return _flip(session, chance, chance.choice([filled, _spans(records)]))


def _in_declaration(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, _spans(session.parsed.of(SCHEMA, CHANNEL)))


def _in_metadata(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, _spans(session.parsed.of(METADATA)))


def _in_attachment(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, _spans(session.parsed.of(ATTACHMENT)))


def _in_record_head(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, _heads(session.parsed.top_level()))


def _in_message_index(session: OpenSession, chance: Random) -> DamagedFile:
    return _flip(session, chance, _spans(session.parsed.of(MESSAGE_INDEX)))


def _zero(session: OpenSession, pages: list[int]) -> DamagedFile:
    data = bytearray(session.data)
    for page in pages:
        size = len(data[page * PAGE : (page + 1) * PAGE])
        data[page * PAGE : page * PAGE + size] = bytes(size)
    return DamagedFile(bytes(data), f"pages {', '.join(map(str, pages))} zero", twice=True)


def _pages(session: OpenSession) -> int:
    return -(-len(session.data) // PAGE)


def _zero_anywhere(session: OpenSession, chance: Random) -> DamagedFile:
    return _zero(session, [chance.randrange(_pages(session))])


def _zero_in_open_chunk(session: OpenSession, chance: Random) -> DamagedFile:
    chunks = session.parsed.of(CHUNK)
    begin = chunks[-1].begin // PAGE if chunks else 0
    return _zero(session, [chance.randrange(begin, _pages(session))])


def _zero_in_last_second(session: OpenSession, chance: Random) -> DamagedFile:
    spans = _last_second(session)
    begin = spans[0][0] // PAGE if spans else 0
    return _zero(session, [chance.randrange(begin, _pages(session))])


def _zero_several(session: OpenSession, chance: Random) -> DamagedFile:
    pages = chance.sample(range(_pages(session)), min(_pages(session), chance.randint(2, 4)))
    return _zero(session, sorted(pages))


def _cut(session: OpenSession, at: int) -> DamagedFile:
    return DamagedFile(session.data[:at], f"cut at byte {at} of {len(session.data)}", natural=True)


def _cut_anywhere(session: OpenSession, chance: Random) -> DamagedFile:
    return _cut(session, chance.randrange(len(session.data)))


def _cut_at_begin(session: OpenSession, chance: Random) -> DamagedFile:
    return _cut(session, chance.choice((0, 1, 8, 9, chance.randrange(100))))


def _cut_at_record(session: OpenSession, chance: Random) -> DamagedFile:
    return _cut(session, chance.choice(session.parsed.records).end)


def _cut_at_top_level(session: OpenSession, chance: Random) -> DamagedFile:
    return _cut(session, chance.choice(session.parsed.top_level()).end)


def _cut_at_page(session: OpenSession, chance: Random) -> DamagedFile:
    return _cut(session, chance.randrange(_pages(session)) * PAGE)


def _cut_in_last_second(session: OpenSession, chance: Random) -> DamagedFile:
    spans = _last_second(session)
    return _cut(session, chance.randrange(spans[0][0] if spans else 0, len(session.data)))


def _power_cut(session: OpenSession, chance: Random) -> DamagedFile:
    """Each page that was not synced is as it was then, or as it is now; the file has the old size, the new, or between.

    The first and the last page of what was synced are written again and again: these are old or new as a whole.
    """
    old, new, likely = session.durable, session.data, chance.choice((0.1, 0.5, 0.9))
    size = chance.choice((len(old), len(new), len(new), chance.randint(min(len(old), len(new)), len(new))))
    data, stale = bytearray(size), []
    for begin in range(0, size, PAGE):
        before, now = (file[begin : begin + PAGE].ljust(PAGE, b"\0") for file in (old, new))
        is_stale = before != now and chance.random() < likely
        if is_stale:
            stale.append(begin // PAGE)
        data[begin : begin + PAGE] = (before if is_stale else now)[: size - begin]
    place = f"pages {stale} are as {len(new) - len(old)} bytes before, size {size} of {len(new)}"
    return DamagedFile(bytes(data), place, natural=True)


def _power_cut_and_flip(session: OpenSession, chance: Random) -> DamagedFile:
    data, place, *_ = _power_cut(session, chance)
    at, bit = chance.randrange(len(data)) if data else 0, chance.randrange(8)
    hit = bytearray(data)
    if hit:
        hit[at] ^= 1 << bit
    return DamagedFile(bytes(hit), f"{place}; bit {bit} of byte {at}", twice=True)


def _none(session: OpenSession, chance: Random) -> DamagedFile:
    return DamagedFile(session.data, "the kill alone", natural=True)


FLIPS: dict[str, DamageFunction] = {
    "flip anywhere": _anywhere,
    "flip in the file head": _in_file_head,
    "flip in a message length": _in_message_length,
    "flip in a message head": _in_message_head,
    "flip in the open chunk": _in_open_chunk,
    "flip in the last second": _in_last_second,
    "flip in a chunk head": _in_chunk_head,
    "flip in the last chunk head": _in_last_chunk_head,
    "flip in checkpoints": _in_checkpoints,
    "flip in a declaration": _in_declaration,
    "flip in metadata": _in_metadata,
    "flip in an attachment": _in_attachment,
    "flip in a record head": _in_record_head,
    "flip in a message index": _in_message_index,
}
ZEROS: dict[str, DamageFunction] = {
    "zero anywhere": _zero_anywhere,
    "zero in the open chunk": _zero_in_open_chunk,
    "zero in the last second": _zero_in_last_second,
    "zero several": _zero_several,
}
CUTS: dict[str, DamageFunction] = {
    "cut anywhere": _cut_anywhere,
    "cut at the begin": _cut_at_begin,
    "cut at a record": _cut_at_record,
    "cut outside of chunks": _cut_at_top_level,
    "cut at a page": _cut_at_page,
    "cut in the last second": _cut_in_last_second,
}
POWER_CUTS: dict[str, DamageFunction] = {"power cut": _power_cut, "power cut and flip": _power_cut_and_flip}
KILLS: dict[str, DamageFunction] = {"kill": _none}
KINDS: dict[str, DamageFunction] = {**FLIPS, **ZEROS, **CUTS, **POWER_CUTS, **KILLS}
