"""The control channel: complete messages in order, without blocking, malformed ones named, and the other side's end."""

from __future__ import annotations

import json
import socket
import typing
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec import UNSET, UnsetType

from fti.messages.control import ControlMessage, PageCommand, PageFault, PageMark, SendBytes, Stop, ToRecorder
from fti.messages.tables import from_table
from fti.service.control_channel import (
    MAX_PENDING_BYTES,
    ControlChannel,
    ControlMessageError,
    decode,
    encode,
    make_memory_file,
    read_memory_file,
)
from tests.helpers import fail, until

CLASSES = {cls.__name__: cls for cls in typing.get_args(ControlMessage)}
st.register_type_strategy(UnsetType, st.just(UNSET))
st.register_type_strategy(
    PageCommand,
    st.builds(PageCommand, *[st.text()] * 4, st.dictionaries(st.text(), st.text())),  # its default is a function
)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
TEXT = "x" * 500
GOOD = {"id": 7, "link": "line", "data": "2a", "until_ns": None}


def sending(**fields: Any) -> bytes:
    """The line of a message with other fields."""
    return json.dumps({"SendBytes": {**GOOD, **fields}}).encode()


def _pair() -> tuple[ControlChannel, ControlChannel]:
    left, right = socket.socketpair()
    return ControlChannel(left, ControlMessage), ControlChannel(right, ControlMessage)


@pytest.mark.parametrize("cls", CLASSES.values(), ids=lambda cls: cls.__name__)
@given(data=st.data())
def test_every_message_arrives_as_it_was_sent(cls: type, data: st.DataObject) -> None:
    message = data.draw(st.from_type(cls))
    assert repr(decode(encode(message), CLASSES)) == repr(message)  # NaN is not equal to itself


@given(st.lists(st.builds(PageMark, st.text(), st.text()), max_size=20))
def test_messages_arrive_whole_and_in_order(messages: list[PageMark]) -> None:
    left, right = _pair()
    for message in messages:
        assert left.send(message)
    assert right.receive(fail) == messages
    left.close()
    right.close()


@given(name=st.sampled_from([*CLASSES, "Nothing"]), fields=JSON, line=st.binary(max_size=40))
@example(name="Stop", fields={}, line=b"[" * 100_000)
@example(name="Stop", fields={}, line=b'{"Stop":{},"Hurry":{}}')
def test_whatever_comes_is_a_message_or_an_error(name: str, fields: Any, line: bytes) -> None:
    for text in (json.dumps({name: fields}).encode(), line):
        try:
            message = decode(text, CLASSES)
        except ControlMessageError as error:
            assert str(error)
        else:
            assert type(message) is CLASSES[next(iter(json.loads(text)))]
            assert repr(decode(encode(message), CLASSES)) == repr(message)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (b"{", "b'{' is not a message: a table with one entry"),
        (b"[1]", "b'[1]' is not a message: a table with one entry"),
        (b'{"PageFault":{"text":"x"}}', "unknown message 'PageFault'; there are Stop, SnapshotTrigger, SendBytes, "),
        (sending(id="7"), "SendBytes: id: Expected `int`, got `str`"),
        (sending(id=True), "SendBytes: id: Expected `int`, got `bool`"),
        (sending(until_ns=1.5), "SendBytes: until_ns: Expected `int | null`, got `float`"),
        (sending(until=1), "SendBytes: Object contains unknown field `until`"),
        (b'{"SendBytes":{"id":7,"link":"line"}}', "SendBytes: Object missing required field `data`"),
        (b'{"SendBytes":[]}', "SendBytes: Expected `object`, got `array`"),
    ],
)
def test_a_malformed_message_is_named_and_the_next_one_is_received(line: bytes, text: str) -> None:
    left, right = socket.socketpair()
    channel, errors = ControlChannel(right, ToRecorder), list[ControlMessageError]()
    left.sendall(line + b"\n" + encode(Stop()))
    assert channel.receive(errors.append) == [Stop()]
    (error,) = errors
    assert str(error).startswith(text)
    left.close()
    channel.close()


def test_the_path_of_a_wrong_field_is_named() -> None:
    report = {"devices": {"ins": {"clocks": [{"scale": 3}]}}, "navigation": {}}
    with pytest.raises(
        ControlMessageError, match=r"^NavigationReport: devices\[...\]\.clocks\[0\]\.scale: Expected `str`, got `int`$"
    ):
        decode(json.dumps({"NavigationReport": report}).encode(), CLASSES)
    with pytest.raises(ValueError, match=r"^data: Expected `str`, got `null`$"):
        from_table(SendBytes, {**GOOD, "data": None})


def test_a_reader_that_does_not_read_costs_no_time_and_bounded_memory() -> None:
    left, right = _pair()
    sent = 0
    while left.send(PageMark("x" * 10_000, str(sent))):
        sent += 1
        assert sent * 10_000 < 8 * MAX_PENDING_BYTES
    assert left.send(PageMark("", str(sent)), is_kept=True), "what is sent once still waits"
    assert not left.send(PageMark("", "-1"))
    found: list[PageMark] = []
    while len(found) <= sent and not right.has_ended:
        found += right.receive(fail)
        left.flush()
    assert [m.who for m in found] == list(map(str, range(sent + 1)))
    left.close()
    right.close()


def test_the_end_of_the_other_side_is_seen_after_its_last_word() -> None:
    left, right = _pair()
    left.send(PageFault("last"))
    left.close()
    assert right.receive(fail) == [PageFault("last")]
    right.receive(fail)
    assert right.has_ended
    assert not right.send(PageFault("anyone there?"))
    right.close()


def test_a_memory_file_carries_any_amount() -> None:
    data = bytes(range(256)) * 40_000
    assert read_memory_file(make_memory_file("test", data)) == data


def test_the_last_messages_of_the_other_side_are_received_though_sending_fails() -> None:
    left, right = _pair()
    right.send(PageFault("last words"))
    right.close()
    assert not left.send(Stop())
    assert left.receive(fail) == [PageFault("last words")]
    assert left.has_ended
    left.close()


def test_threads_do_not_tear_each_others_messages() -> None:
    """The socket is small, so that nearly every message is handed over in pieces."""
    left, right = socket.socketpair()
    left.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2048)
    sender, receiver = ControlChannel(left, ControlMessage), ControlChannel(right, ControlMessage)
    found: list[PageMark] = []
    with ThreadPoolExecutor(3) as pool:
        jobs = [pool.submit(_send_many, sender, who) for who in range(3)]
        until(lambda: _received(receiver, sender, found) == 900, what="900 messages")
        for job in jobs:
            job.result()
    for who in range(3):
        assert [m.text for m in found if m.who == str(who)] == [f"{n} {TEXT}" for n in range(300)]
    sender.close()
    receiver.close()


def _send_many(sender: ControlChannel, who: int) -> None:
    for n in range(300):
        assert sender.send(PageMark(f"{n} {TEXT}", str(who)))


def _received(receiver: ControlChannel, sender: ControlChannel, found: list[PageMark]) -> int:
    sender.flush()
    found += receiver.receive(fail)
    return len(found)
