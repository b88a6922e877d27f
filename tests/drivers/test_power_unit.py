"""The power unit of the laboratory: commands, answers, completeness of its state."""

from __future__ import annotations

import pytest

from fti.drivers import power_unit as pdu
from fti.messages.measurements import Ack, DeviceStatus, Measurement, Reading, Stamp

S = Stamp(0)
OPTIONS = pdu.Options()


def cycle(**states: str) -> list[bytes]:
    """What the unit says of its breakers, sentence by sentence."""
    encoder = pdu.make_encoder(OPTIONS)
    readings = [Reading(stamp=S, name=name, value=0.5, unit="A", text=state) for name, state in states.items()]
    return [line for m in [*readings, *pdu.decode_supply(28.0, 1.0, S)] for line in encoder.encode(m)]


def decoded(*lines: bytes) -> list[Measurement]:
    return pdu.make_decoder(OPTIONS).feed(b"".join(lines), 7)


def statuses(*lines: bytes) -> list[DeviceStatus]:
    return [m for m in decoded(*lines) if isinstance(m, DeviceStatus)]


def test_every_breaker_that_is_not_on_is_a_flag() -> None:
    (status,) = statuses(*cycle(altimeter="tripped", gnss="brown_out", ins="on", air_data="off", ahrs="starting"))
    assert status.flags == ("altimeter_tripped", "gnss_brown_out", "air_data_off", "ahrs_starting")
    assert not status.ok
    (status,) = statuses(*cycle(altimeter="on", ins="on"))
    assert (status.ok, status.flags) == (True, ())


def test_a_cycle_of_which_a_breaker_was_not_received_says_nothing_of_the_whole() -> None:
    first, *others = cycle(altimeter="tripped", ins="on")
    assert statuses(*others) == []
    assert [m.ok for m in statuses(*others, first, *others)] == [False]


@pytest.mark.parametrize("name", pdu.COMMANDS)
def test_a_command_reaches_the_unit_in_any_pieces_and_its_answer_comes_back(name: str) -> None:
    requests: list[tuple[str, str]] = []

    def handle_command(command: str, breaker: str) -> tuple[bool, str]:
        requests.append((command, breaker))
        return name != "reset", "so it is"

    encoder = pdu.make_encoder(OPTIONS)
    encoder.handle_command = handle_command
    data = b"noise" + pdu.command(name, {"breaker": "altimeter"}, OPTIONS)
    answers = [answer for at in range(len(data)) for answer in encoder.respond(data[at : at + 1])]
    assert requests == [(name, "altimeter")]
    (ack,) = decoded(*answers)
    assert ack == Ack(stamp=Stamp(7), command=name, accepted=name != "reset", detail="altimeter: so it is")


def test_a_damaged_command_is_not_obeyed() -> None:
    encoder = pdu.make_encoder(OPTIONS)
    data = pdu.command("off", {"breaker": "altimeter"}, OPTIONS)
    for at in range(len(data) - 2):
        assert encoder.respond(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]) == [], at
        encoder.respond(b"\r\n")
    assert len(encoder.respond(data)) == 1


def test_a_unit_without_breakers_refuses() -> None:
    answers = pdu.make_encoder(OPTIONS).respond(pdu.command("off", {"breaker": "gnss"}, OPTIONS))
    (ack,) = decoded(*answers)
    assert ack == Ack(stamp=Stamp(7), command="off", accepted=False, detail="gnss: unknown breaker gnss")


@pytest.mark.parametrize(
    ("args", "words"),
    [
        ({}, "breaker is missing"),
        ({"breaker": "Gnss"}, "breaker = 'Gnss': must be the name of a device"),
        ({"breaker": "gnss*00\r\n$PFTI"}, "must be the name of a device"),
        ({"breaker": "a" * 65}, "64 characters at most"),
        ({"breaker": "gnss", "now": "yes"}, "no argument 'now'"),
    ],
)
def test_what_no_unit_could_do_is_refused_before_it_is_sent(args: dict[str, str], words: str) -> None:
    with pytest.raises(ValueError, match=words.replace("*", r"\*")):
        pdu.command("off", args, OPTIONS)
