"""Checksums and identifiers, spoiled: a decoder misses just the spoiled messages, and takes all others."""

from __future__ import annotations

from collections import Counter

import pytest

from fti import drivers
from fti.drivers import Decoder
from fti.drivers.arinc429 import apmp, chapter10
from fti.hil.faults.fault_targets import (
    CHECKSUMS,
    DRIVERS_WITH_TIME,
    LABELS,
    checksum_change,
    identifier_change,
    sends_time,
)
from tests.hil.faults.device_flights import DEVICES, POLLED, bind_device, nominal

EVERY = 5  # of so many messages one is spoiled
#: What a decoder counts for a message whose identifier it does not know; a CAN frame is skipped as "other_id".
UNKNOWN = {
    "arinc429": {"other"},
    "arinc429_apmp": {"other"},
    "arinc429_chapter10": {"packet_0x01"},
    "arinc429_little": {"other"},
    "imar_ixcom": {"0xEE"},
    "lightware_binary": {"250"},
    "mavlink": {"DEBUG"},
    "multibeam_altimeter": {"238"},
    "nmea0183": {"XXX"},
    "novatel_oem6": {"message 65534"},
    "power_unit": {"(other)"},
    "ublox_ubx": {"NAV-0xEE", "RXM-0xEE"},
}
TALKING = [name for name in DEVICES if name not in POLLED]
WITH_CHECKSUM = [name for name in TALKING if checksum_change(DEVICES[name].driver, bind_device(name).options)]
WITH_LABEL = [name for name in TALKING if identifier_change(DEVICES[name].driver, bind_device(name).options)]


def sent_messages(name: str) -> list[bytes]:
    return [message for _, messages in nominal(name) for message in messages]


def decode(name: str, messages: list[bytes]) -> Decoder:
    """A decoder that was fed the messages."""
    bound = bind_device(name)
    decoder = bound.driver.make_decoder(bound.options)
    for k, message in enumerate(messages):
        decoder.feed(message, k * 10**7)
    return decoder


def spoiled_places(messages: list[bytes]) -> range:
    """Not the first ones, which prove where words begin; and not the last ones, behind which nothing proves it."""
    return range(40, len(messages) - 40, EVERY) if len(messages) > 100 else range(10, len(messages) - 5, EVERY)


def test_the_tables_are_those_of_the_drivers() -> None:
    assert set(CHECKSUMS) | set(LABELS) | set(DRIVERS_WITH_TIME) <= set(drivers.names())
    tried = {DEVICES[name].driver for name in DEVICES}
    assert tried == set(drivers.names())
    assert {DEVICES[name].driver for name in WITH_CHECKSUM} == set(CHECKSUMS)
    assert {DEVICES[name].driver for name in WITH_LABEL} | {"lightware_ascii"} == set(LABELS)


def words_in(name: str, message: bytes) -> int:
    """Of a packet each word is a message, and in APMP each has a parity of its own."""
    if name == "arinc429_apmp":
        return (len(message) - apmp.HEADER.size - apmp.TIMES.size) // apmp.RECORD.size
    return chapter10.SPECIFIC.unpack_from(message, chapter10.HEADER.size)[0] if name == "arinc429_chapter10" else 1


@pytest.mark.parametrize("name", WITH_CHECKSUM)
def test_a_wrong_checksum_costs_just_the_message_that_has_it(name: str) -> None:
    bound, messages = bind_device(name), sent_messages(name)
    spoil = checksum_change(bound.device.driver, bound.options)
    assert spoil is not None
    places = spoiled_places(messages)
    wrong = [spoil(m) if k in places else m for k, m in enumerate(messages)]
    assert all(len(w) == len(m) for w, m in zip(wrong, messages, strict=True))
    good = decode(name, messages)
    decoder = decode(name, wrong)
    lost = good.counters.messages - decoder.counters.messages
    assert sum(lost.values()) == sum(words_in(name, messages[k]) for k in places)
    assert {"bad_checksum", "bad_parity"} & {*decoder.counters.skipped, *decoder.counters.messages}
    assert not {"bad_checksum", "bad_parity"} & {*good.counters.skipped, *good.counters.messages}


@pytest.mark.parametrize("name", WITH_CHECKSUM)
def test_only_the_checksum_is_wrong(name: str) -> None:
    """At most eight neighbouring bytes differ, and of a word on a bus its parity alone."""
    bound = bind_device(name)
    spoil = checksum_change(bound.device.driver, bound.options)
    assert spoil is not None
    for message in sent_messages(name)[:20]:
        differ = [a ^ b for a, b in zip(message, spoil(message), strict=True)]
        places = [at for at, difference in enumerate(differ) if difference]
        if bound.device.driver == "arinc429" and name != "arinc429_chapter10":
            assert [differ[at] for at in places] == [0x80] * words_in(name, message)
        else:
            assert places[-1] - places[0] < 8


@pytest.mark.parametrize("name", WITH_LABEL)
def test_a_wrong_identifier_is_one_that_nobody_knows_and_everything_else_holds(name: str) -> None:
    bound, messages = bind_device(name), sent_messages(name)
    spoil = identifier_change(bound.device.driver, bound.options)
    assert spoil is not None
    places = spoiled_places(messages)
    wrong = [spoil(m) if k in places else m for k, m in enumerate(messages)]
    good = decode(name, messages)
    decoder = decode(name, wrong)
    lost = good.counters.messages - decoder.counters.messages
    new = decoder.counters.messages - good.counters.messages
    assert sum(lost.values()) == sum(words_in(name, messages[k]) for k in places)
    if {"can"} == bound.driver.CARRIERS:
        assert decoder.counters.skipped == Counter(other_id=16 * len(places))
    else:
        assert decoder.counters.skipped == good.counters.skipped
        assert set(new) <= UNKNOWN[name]
        assert sum(new.values()) == (len(places) if name == "arinc429_chapter10" else sum(lost.values()))


def test_only_what_is_on_the_wire_can_be_wrong_in_time() -> None:
    timed = {name for name in DEVICES if sends_time(DEVICES[name].driver, bind_device(name).options)}
    assert timed == {*DRIVERS_WITH_TIME, "arinc429_apmp", "arinc429_chapter10"} - {"arinc429"}
