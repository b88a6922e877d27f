"""Kinds of damage to a recorded session: hostile contents, and damaged bytes."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType

from tests.hostile.recipes import BEGIN, CONFIG, NAME, STEP, File, Message, Session, session

Damage = Callable[[random.Random], Session]
DEEP = 100_000
DIGITS = b"9" * 4000
MORE_DIGITS = b"9" * 5000
RAW, DERIVED, TRUTH = f"{NAME}_000.mcap", f"{NAME}_derived_000.mcap", f"{NAME}_truth_000.mcap"
#: Notes that are JSON, and the file that each is in.
NOTES = {
    "/fti/clock": RAW,
    "/fti/ledger": RAW,
    "/fti/health": RAW,
    "/fti/event": RAW,
    "/fti/gap": RAW,
    "/fti/terrain": DERIVED,
    "/fti/device_clock": DERIVED,
    "/nav/height_above_ground/altimeter": DERIVED,
    "/nav/nav_solution": DERIVED,
    "/gnss/device_status": DERIVED,
    "/truth/state": TRUTH,
}
#: What stands in the place of a note.
BODIES: dict[str, bytes] = {
    "deep JSON": b"[" * DEEP + b"]" * DEEP,
    "deep tables": b'{"a":' * DEEP + b"1" + b"}" * DEEP,
    "no keys": b"{}",
    "a list": b"[1, 2]",
    "null": b"null",
    "a number": b"3",
    "no JSON": b"\x00\xff\xfe{",
    "nothing": b"",
    "a text": b'"x"',
    "UTF-16": '{"a": 1}'.encode("utf-16"),
    "a cut": b'{"t_ns": 17',
}
#: What stands in the place of every value of a note.
VALUES: dict[str, bytes] = {
    "4000 digits": DIGITS,
    "5000 digits": MORE_DIGITS,
    "2^63": b"9223372036854775808",
    "2^64": b"18446744073709551616",
    "negative": b"-9223372036854775809",
    "surrogates": b'"\\ud800 half"',
    "NUL": b'"a\\u0000b"',
    "NaN": b"NaN",
    "infinite": b"1e999",
    "null values": b"null",
    "texts": b'"x"',
    "tables": b'{"x": [1, {"y": null}]}',
    "lists": b'[[], {}, null, "x", 1]',
    "long text": b'"' + b"x" * 200_000 + b'"',
    "booleans": b"true",
}
CONFIGS: dict[str, bytes] = {
    "not UTF-8": b"[session]\nname = '\xff\xfe'\n",
    "deep TOML": b"a = " + b"[" * DEEP + b"]" * DEEP,
    "deep keys": b"a" + b".b" * 20_000 + b" = 1",
    "deep inline": b"a = " + b"{a=" * 900 + b"1" + b"}" * 900,
    "digits": CONFIG.encode().replace(b"rate_hz = 5", b"rate_hz = " + DIGITS),
    "more digits": CONFIG.encode().replace(b"rate_hz = 5", b"rate_hz = " + MORE_DIGITS),
    "empty": b"",
    "NUL": b"\x00" * 100,
    "wrong types": b"session = 1\nlink = 'x'\ndevice = [1, 2]\n",
    "wrong device": b"device = 5\n",
    "huge": b"a = 1\n#" + b"x" * 5_000_000,
    "rate NaN": CONFIG.encode().replace(b"rate_hz = 5", b"rate_hz = nan"),
    "surrogate": b'a = "\\ud800"',
    "NUL name": CONFIG.encode().replace(b'directory = "data"', b'directory = "a\\u0000b"'),
    "profile": CONFIG.encode() + b'\n[nav.approach]\nprofile = "x.csv"\n',
}


def _note_damages() -> dict[str, Damage]:
    damages: dict[str, Damage] = {}
    for topic, file in NOTES.items():
        for name, body in BODIES.items():
            damages[f"{topic}: {name}"] = _with_body(file, topic, body)
        for name, value in VALUES.items():
            damages[f"{topic}: {name}"] = _with_values(file, topic, value)
    return damages


def _with_body(file: str, topic: str, body: bytes) -> Damage:
    def make(rng: random.Random) -> Session:
        result = session()
        for message in _of(result, file, topic)[rng.randrange(2) :]:
            message.data = body
        return result

    return make


def _of(result: Session, file: str, topic: str) -> list[Message]:
    return [message for message in result.files[file].messages if message.topic == topic]


def _with_values(file: str, topic: str, value: bytes) -> Damage:
    """One value of every note, or all of them."""

    def make(rng: random.Random) -> Session:
        result = session()
        messages = _of(result, file, topic)
        tables = [json.loads(message.data) for message in messages]
        paths = sorted(_paths(tables[0]))
        chosen = set(paths) if rng.random() < 0.3 else {rng.choice(paths)}
        for message, table in zip(messages, tables, strict=True):
            message.data = _encoded(table, chosen, value)
        return result

    return make


def _paths(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(one for key, each in inner for one in _paths(each, (*path, key)))] if path or inner else [path]


def _encoded(value: Any, chosen: set[tuple[Any, ...]], instead: bytes, path: tuple[Any, ...] = ()) -> bytes:
    if path and path in chosen:
        return instead
    if isinstance(value, dict):
        inner = (json.dumps(k).encode() + b":" + _encoded(v, chosen, instead, (*path, k)) for k, v in value.items())
        return b"{" + b",".join(inner) + b"}"
    if isinstance(value, list):
        return b"[" + b",".join(_encoded(v, chosen, instead, (*path, k)) for k, v in enumerate(value)) + b"]"
    return json.dumps(value).encode()


def _config(data: bytes | None) -> Damage:
    def make(rng: random.Random) -> Session:
        result = session()
        for file in (RAW, DERIVED):
            result.files[file].attachments = {} if data is None else {"config.toml": data}
        return result

    return make


def _changed(change: Callable[[Session, random.Random], None]) -> Damage:
    def make(rng: random.Random) -> Session:
        result = session()
        change(result, rng)
        return result

    return make


def _any_file(result: Session, rng: random.Random) -> File:
    return result.files[rng.choice(list(result.files))]


def _other_attachment(result: Session, rng: random.Random) -> None:
    for file in result.files.values():
        file.attachments = {"device[0].options.dbc_file": b"\xff\x00\xfe", **file.attachments}


def _scenario(data: bytes) -> Damage:
    return _changed(lambda made, rng: made.files[TRUTH].attachments.update({"scenario.json": data}))


def _metadata(result: Session, rng: random.Random) -> None:
    wild = {
        "\0": "\0",
        "name": "\x1b[2J" + "x" * 10_000,
        "mode": "=1+1",
        "kind": "nothing",
        "place_1": "\0/" + "y" * 5000,
    }
    for file in result.files.values():
        for table in file.metadata.values():
            table.update(wild)


def _many_metadata(result: Session, rng: random.Random) -> None:
    _any_file(result, rng).metadata.update({f"t{k}": {"a": "b"} for k in range(60_000)})


def _links(result: Session, rng: random.Random) -> None:
    for file in result.files.values():
        file.metadata["fti.links"] = rng.choice(
            [{}, {"": ""}, {"x" * 5000: "udp"}, {f"l{k}": "udp" for k in range(6000)}]
        )


def _times(result: Session, rng: random.Random) -> None:
    t = rng.choice([2**63 - 1, 2**63, 2**64 - 1, 0])
    for message in rng.sample(result.files[RAW].messages, 5) + rng.sample(result.files[DERIVED].messages, 5):
        message.t = t
        message.published = rng.choice([0, 2**64 - 1, None])


def _truth_times(result: Session, rng: random.Random) -> None:
    for message in rng.sample(result.files[TRUTH].messages, 5):
        message.t = rng.choice([2**63 - 1, 2**63, 0])


def _numbers(result: Session, rng: random.Random) -> None:
    for message in result.files[RAW].messages:
        if rng.random() < 0.1:
            message.sequence = rng.choice([0, 2**31, 2**32 - 1, message.sequence])


def _topics(result: Session, rng: random.Random) -> None:
    names = (
        "a\0b",
        "/raw/" + "x" * 100_000,
        "",
        "/",
        "/raw/",
        "/raw/gnss\n",
        "/../../x",
        "/raw/unknown",
        "/nav/",
        "/tx/\0",
    )
    file = _any_file(result, rng)
    for name in rng.sample(names, 3):
        file.messages.append(Message(name, BEGIN, b"{}", 1, rng.choice(["json", "x-fti-raw"])))


def _unknown_link(result: Session, rng: random.Random) -> None:
    result.files[RAW].messages.append(Message("/raw/stranger", BEGIN, b"x", 900, "x-fti-raw"))


def _many_topics(result: Session, rng: random.Random) -> None:
    file = _any_file(result, rng)
    file.messages += [Message(f"/x{k}", BEGIN + k, b"{}") for k in range(5000)]


def _encodings(result: Session, rng: random.Random) -> None:
    for message in result.files[DERIVED].messages:
        if message.topic.startswith("/nav"):
            message.encoding = "protobuf"


def _packed(result: Session, rng: random.Random) -> None:
    for file in result.files.values():
        file.compression = rng.choice([CompressionType.ZSTD, CompressionType.LZ4])


def _columns(result: Session, rng: random.Random) -> None:
    body = json.dumps({f"k{n}": n for n in range(140_000)}).encode()
    result.files[DERIVED].messages.append(Message("/nav/wide", BEGIN, body))


def _far_apart(result: Session, rng: random.Random) -> None:
    result.files[RAW].messages[-1].t = 1
    result.files[DERIVED].messages[-1].t = 2**63 - 2


def _kind(result: Session, rng: random.Random) -> None:
    for file in result.files.values():
        file.metadata["fti.file"]["kind"] = rng.choice(["raw", "derived", "truth", "snapshot", ""])


def _snapshot(result: Session, rng: random.Random) -> None:
    for file in result.files.values():
        file.metadata["fti"]["mode"] = "snapshot"
    result.files[f"{NAME}_snapshot_000.mcap"] = result.files[RAW]


def _empty(result: Session, rng: random.Random) -> None:
    _any_file(result, rng).messages.clear()


# -------------------------------------------------------------------------------------------------------------- bytes


def _bytes(change: Callable[[bytearray, random.Random], bytes | bytearray]) -> Damage:
    """The bytes of one file are changed."""

    def make(rng: random.Random) -> Session:
        result = session()
        if rng.random() < 0.5:
            _packed(result, rng)

        def after(place: Path) -> None:
            path = rng.choice(sorted(place.glob("*.mcap")))
            path.write_bytes(change(bytearray(path.read_bytes()), rng))

        result.after.append(after)
        return result

    return make


def _flips(data: bytearray, rng: random.Random) -> bytearray:
    for _ in range(rng.choice([1, 1, 3, 50])):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return data


def _head_flips(data: bytearray, rng: random.Random) -> bytearray:
    """In what stands before the first chunk."""
    for _ in range(rng.choice([1, 2, 5])):
        data[rng.randrange(min(400, len(data)))] ^= 1 << rng.randrange(8)
    return data


def _tail_flips(data: bytearray, rng: random.Random) -> bytearray:
    """In the summary."""
    for _ in range(rng.choice([1, 2, 5])):
        data[-rng.randrange(1, min(800, len(data)))] ^= 1 << rng.randrange(8)
    return data


def _lengths(data: bytearray, rng: random.Random) -> bytearray:
    """A length, wherever one may stand, becomes very large."""
    at = rng.randrange(8, len(data) - 8)
    size = rng.choice([4, 8])
    data[at : at + size] = rng.choice([b"\xff", b"\x7f", b"\x00"]) * size
    return data


def _cut(data: bytearray, rng: random.Random) -> bytearray:
    return data[: rng.randrange(len(data))]


def _hole(data: bytearray, rng: random.Random) -> bytearray:
    at = rng.randrange(len(data))
    data[at : at + 4096] = bytes(len(data[at : at + 4096]))
    return data


def _inserted(data: bytearray, rng: random.Random) -> bytearray:
    at = rng.randrange(len(data))
    return data[:at] + rng.randbytes(rng.choice([1, 9, 500])) + data[at:]


def _removed(data: bytearray, rng: random.Random) -> bytearray:
    at = rng.randrange(len(data))
    return data[:at] + data[at + rng.choice([1, 9, 500]) :]


def _twice(data: bytearray, rng: random.Random) -> bytearray:
    return data + data


def _garbage(data: bytearray, rng: random.Random) -> bytearray:
    return bytearray(bytes(rng.choice([b"", bytes(data[:8])])) + rng.randbytes(rng.randrange(3000)))


def _named(name: str) -> Damage:
    def make(rng: random.Random) -> Session:
        result = session()
        result.files[name] = result.files[RAW]
        return result

    return make


def _last_step(result: Session, rng: random.Random) -> None:
    """Frames that go back in time."""
    for k, message in enumerate(result.files[RAW].messages):
        message.t = BEGIN + (len(result.files[RAW].messages) - k) * STEP


DAMAGES: dict[str, Damage] = {
    **_note_damages(),
    **{f"recorded config: {name}": _config(data) for name, data in CONFIGS.items()},
    "no config": _config(None),
    "flown scenario: deep": _scenario(BODIES["deep JSON"]),
    "flown scenario: a list": _scenario(b"[]"),
    "flown scenario: not UTF-8": _scenario(b"\xff"),
    "flown scenario: digits": _scenario(b'{"seed": ' + DIGITS + b"}"),
    "other attachment": _changed(_other_attachment),
    "metadata": _changed(_metadata),
    "many metadata": _changed(_many_metadata),
    "links": _changed(_links),
    "times": _changed(_times),
    "truth times": _changed(_truth_times),
    "numbers": _changed(_numbers),
    "topics": _changed(_topics),
    "unknown link": _changed(_unknown_link),
    "many topics": _changed(_many_topics),
    "encodings": _changed(_encodings),
    "packed": _changed(_packed),
    "columns": _changed(_columns),
    "far apart": _changed(_far_apart),
    "kind": _changed(_kind),
    "snapshot": _changed(_snapshot),
    "empty": _changed(_empty),
    "backwards": _changed(_last_step),
    "file number": _named("x_99999999999.mcap"),
    "long file number": _named(f"x_{'9' * 200}.mcap"),
    "file name": _named("\udcff\udcfe\n_000.mcap"),
    **{
        f"bytes: {change.__name__.strip('_')} {k}": _bytes(change)
        for change in (_flips, _head_flips, _tail_flips, _lengths, _cut, _hole, _inserted, _removed, _twice, _garbage)
        for k in range(3)
    },
}
