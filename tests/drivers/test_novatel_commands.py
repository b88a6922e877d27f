"""NovAtel OEM6: commands, answers, requests after a connect, the emulated receiver."""

from __future__ import annotations

import re

import pytest
from msgspec.structs import replace

from fti.drivers import Encoder
from fti.drivers import novatel_oem6 as novatel
from fti.drivers.novatel_oem6 import clock, commands, messages
from fti.drivers.novatel_oem6.framing import RESPONSE_BIT, SYNC, crc32, measure
from fti.messages.measurements import Ack, DeviceStatus, DeviceTime, Position, Reading, ReceiverClock, Stamp, TimeScale
from tests.drivers.test_novatel_oem6 import STAMP, T_GPS_NS, decode, frame, only

# ------------------------------------------------------------------------------------------------------- commands


def test_log_is_the_bytes_that_the_document_prints() -> None:
    """docs.novatel.com, Commands, "Binary Example": LOG COM1 BESTPOSB ONTIME 1."""
    printed = (
        "AA44121C 010000C0 20000000 00FF0000 00000000 00000000 00000000 20000000 2A000000 02000000 00000000 0000F03F"
        "00000000 00000000 00000000 34D32DC1"
    )
    made = novatel.command("log", {"message": "bestpos", "period": "1", "port": "com1"})
    assert made == bytes.fromhex(printed.replace(" ", ""))


@pytest.mark.parametrize(
    ("name", "args", "body"),
    [
        ("unlog", {"message": "RANGE"}, "c0000000 2b00 00 00"),
        ("unlog", {"message": "1043", "port": "usb1"}, "a0050000 1304 00 00"),
        ("unlogall", {}, "06000000 00000000"),
        ("unlogall", {"port": "all"}, "08000000 00000000"),
        ("reset", {}, "00000000"),
        ("reset", {"delay": "30"}, "1e000000"),
        ("antennapower", {"state": "on"}, "01000000"),
        ("log", {"message": "rxstatus", "trigger": "onchanged"}, "c0000000 5d000000 01000000" + "00" * 20),
    ],
)  # fmt: skip
def test_commands_have_the_layout_of_the_document(name: str, args: dict[str, str], body: str) -> None:
    made = novatel.command(name, args)
    assert made[28:-4].hex() == body.replace(" ", "")
    assert made[4:8] == bytes([commands.NUMBERS[name], 0, 0, 0xC0])


@pytest.mark.parametrize(
    ("name", "args", "says"),
    [
        ("log", {"message": "bestpos"}, "period is missing: must be a number of seconds"),
        ("log", {"period": "1"}, "message is missing"),
        (
            "log",
            {"message": "bestpos", "period": "0.3"},
            r"period = 0.3: must be 0.01, .* 0.5 or whole seconds up to 86400",
        ),
        ("log", {"message": "bestpos", "period": "nan"}, "period = nan: must be"),
        ("log", {"message": "bestpos", "period": "often"}, "period = 'often': must be a number"),
        (
            "log",
            {"message": "nothing", "period": "1"},
            "message = 'nothing': must be a number from 1 to 65535 or one of",
        ),
        ("log", {"message": "70000", "period": "1"}, "message = '70000'"),
        ("log", {"message": "\u00b2", "period": "1"}, "must be a number from 1 to 65535 or one of"),
        ("log", {"message": "bestpos", "trigger": "now"}, "trigger = 'now': must be one of onnew, onchanged"),
        ("log", {"message": "bestpos", "trigger": "once", "period": "1"}, "only trigger ontime has one"),
        ("log", {"message": "bestpos", "period": "1", "port": "com9"}, "port = 'com9': must be one of thisport, com1"),
        ("log", {"message": "bestpos", "rate": "1"}, "no argument 'rate'; there are message, period, trigger, port"),
        ("reset", {"delay": "61"}, "delay = '61': must be whole seconds from 0 to 60"),
        ("antennapower", {}, "state is missing: must be one of off, on"),
        ("fly", {}, "no command 'fly'; there are log, unlog"),
    ],
)
def test_a_command_that_is_wrong_is_refused_with_what_is_allowed(name: str, args: dict[str, str], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        novatel.command(name, args)


def answer(number: int, body: bytes) -> bytes:
    return frame(number, body, message_type=RESPONSE_BIT)


def ascii_answer(text: bytes) -> bytes:
    return b"#%s*%08x\r\n" % (text, crc32(text))


@pytest.mark.parametrize(
    ("data", "command", "accepted", "detail"),
    [
        (answer(1, b"\x01\0\0\0OK"), "log", True, "OK"),
        (answer(38, b"\x01\0\0\0OK\0"), "unlogall", True, "OK"),
        (answer(1, b"\x15\0\0\0Requested rate is invalid"), "log", False, "Requested rate is invalid"),
        (answer(18, b"\x05\0\0\0"), "reset", False, "code 5"),
        (b"<OK\r\n", "", True, "OK"),
        (b"<ERROR:Invalid Message. Field = 2\r\n", "", False, "Invalid Message. Field = 2"),
        (ascii_answer(b"LOGR,COM1,0,49.0,FINE,1949,1,0,0;Invalid Message ID"), "log", False, "Invalid Message ID"),
        (ascii_answer(b"UNLOGR,COM1,0,49.0,FINE,1949,1,0,0;Invalid Message ID"), "unlog", False, "Invalid Message ID"),
    ],
)  # fmt: skip
def test_answers_say_which_command_and_why_not(data: bytes, command: str, accepted: bool, detail: str) -> None:
    decoder = novatel.make_decoder(novatel.Options())
    (found,) = decoder.feed(data, 5)
    assert isinstance(found, Ack)
    assert (found.command, found.accepted, found.detail) == (command, accepted, detail)
    assert decoder.counters.messages == {"response": 1}
    assert decoder.counters.framed == len(data)


def test_an_accepted_standing_request_is_counted_only() -> None:
    decoder = novatel.make_decoder(novatel.Options())
    assert decoder.feed(ascii_answer(b"LOGR,COM1,0,49.0,FINE,1949,1.0,0,0,0;OK"), 5) == []
    assert decoder.counters.messages == {"response": 1}


def test_the_answer_to_a_command_of_somebody_else_is_not_ours() -> None:
    assert decode(answer(162, b"\x01\0\0\0OK")) == []


# ---------------------------------------------------------------------------------------------- asking, the emulator


def test_a_standing_request_is_the_line_that_the_document_prints() -> None:
    """docs.novatel.com, Commands, "ASCII Example"; but for the port: it is not known to which we are connected."""
    printed = b"#LOGA,THISPORT,0,0,UNKNOWN,0,0.0,0,0,0;COM1,BESTPOSB,ONTIME,1.000000,0.000000,NOHOLD*ec9ce601\r\n"
    assert measure(bytearray(printed)) == len(printed)
    ours = commands.periodic_log_request("bestpos", 1.0)
    assert measure(bytearray(ours)) == len(ours)
    assert ours.partition(b"*")[0] == printed.partition(b"*")[0].replace(b"COM1", b"THISPORT")


def requested(data: bytes) -> list[tuple[str, str, float]]:
    """Message, trigger and period of each LOG."""
    lines = [line.partition(b";")[2].decode().split(",") for line in data.splitlines()]
    return [(fields[1], fields[2], float(fields[3])) for fields in lines]


def test_the_aircraft_s_logs_are_asked_for_after_a_connect_and_again() -> None:
    options = novatel.Options()
    first = b"".join(novatel.on_connect(options))
    assert requested(first) == [
        ("BESTPOSB", "ONTIME", 0.1), ("BESTVELB", "ONTIME", 0.1), ("TIMEB", "ONTIME", 1.0),
        ("CLOCKMODELB", "ONTIME", 1.0), ("PSRDOPB", "ONTIME", 1.0), ("RANGEB", "ONTIME", 1.0),
        ("RXSTATUSB", "ONTIME", 1.0), ("SATVIS2B", "ONTIME", 10.0),
    ]  # fmt: skip
    assert novatel.poll(options) == (10.0, first)
    assert novatel.poll(novatel.Options(ask_again_s=0.0)) is None
    assert novatel.poll(novatel.Options(logs={})) is None
    changes = novatel.Options(logs={"rxstatus": 0.0})
    assert requested(b"".join(novatel.on_connect(changes))) == [("RXSTATUSB", "ONCHANGED", 0.0)]


@pytest.mark.parametrize(
    ("logs", "says"),
    [
        ({"nothing": 1.0}, "message = 'nothing'"),
        ({"999": 1.0}, "message = '999': must be one of"),
        ({"range": 0.3}, "period = 0.3"),
    ],
)
def test_logs_that_the_receiver_would_refuse_are_refused_here(logs: dict[str, float], says: str) -> None:
    with pytest.raises(ValueError, match=re.escape(says)):
        novatel.Options(logs=logs)


POSITION = Position(stamp=STAMP, lat=0.8, lon=0.2, alt_msl=500.0, undulation=46.5)


def sent_in(encoder: Encoder, seconds: float) -> int:
    """How many BESTPOS are sent when a position is measured every 50 ms."""
    count = 0
    for k in range(round(seconds / 0.05)):
        at = Stamp(5, T_GPS_NS + k * 50_000_000, TimeScale.GPS)
        count += len(encoder.encode(replace(POSITION, stamp=at)))
    return count


def test_the_emulated_receiver_is_silent_until_it_is_asked() -> None:
    encoder = novatel.make_encoder(novatel.Options())
    assert sent_in(encoder, 1.0) == 0
    (reply,) = encoder.respond(novatel.command("log", {"message": "bestpos", "period": "0.1"}))
    assert only(reply, Ack).command == "log"
    assert sent_in(encoder, 1.0) == 10
    encoder.respond(novatel.command("unlog", {"message": "bestpos"}))
    assert sent_in(encoder, 1.0) == 0
    for data in novatel.on_connect(novatel.Options()):
        (reply,) = encoder.respond(data)
        assert reply.startswith(b"#LOGR,COM1,")
        assert decode(reply) == []  # accepted: nothing that anybody must know
    assert sent_in(encoder, 1.0) == 10
    assert encoder.respond(commands.periodic_log_request("range", 1.0).replace(b"RANGE", b"RANGF")) == []
    encoder.respond(novatel.command("reset", {}))  # as when it is switched off and on
    assert sent_in(encoder, 1.0) == 0
    again = novatel.poll(novatel.Options())
    assert again is not None
    assert len(encoder.respond(again[1])) == 8
    assert sent_in(encoder, 1.0) == 10
    assert sent_in(novatel.make_encoder(novatel.Options(unasked=True)), 1.0) == 20


def test_a_question_is_understood_in_pieces_and_behind_noise() -> None:
    encoder = novatel.make_encoder(novatel.Options())
    data = b"\xaa\x00\r\n" + novatel.command("log", {"message": "bestpos", "trigger": "once"})
    replies = [reply for at in range(len(data)) for reply in encoder.respond(data[at : at + 1])]
    assert [only(r, Ack).accepted for r in replies if r.startswith(SYNC)] == [True]
    assert sent_in(encoder, 1.0) == 1


def test_what_has_not_changed_is_not_sent_on_change() -> None:
    encoder = novatel.make_encoder(novatel.Options())
    encoder.respond(novatel.command("log", {"message": "rxstatus", "trigger": "onchanged"}))
    well, ill = (DeviceStatus(stamp=STAMP, ok=True, flags=flags) for flags in ((), ("cpu_overload",)))
    assert [len(encoder.encode(m)) for m in (well, well, ill, ill, well)] == [1, 0, 1, 0, 1]


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (b"log bestposb ontime 0.1\r\n", b"<OK\r\n[COM1]"),
        (b"LOG COM1 BESTPOSB ONTIME 0.1\n", b"<OK\r\n[COM1]"),
        (b"log bestposb ontime 0.3\r", b"<ERROR:Invalid Message. Field = 1\r\n[COM1]"),
        (b"fly away\r\n", b"<ERROR:Invalid Message ID\r\n[COM1]"),
    ],
)
def test_the_emulated_receiver_understands_what_people_type(line: bytes, says: bytes) -> None:
    encoder = novatel.make_encoder(novatel.Options())
    assert encoder.respond(line) == [b"\r\n" + says]
    assert sent_in(encoder, 1.0) == (10 if b"OK" in says else 0)


def test_the_emulated_receiver_refuses_what_a_receiver_refuses() -> None:
    encoder = novatel.make_encoder(novatel.Options())
    unknown = frame(messages.LOG, commands.LOG.pack(192, 60000, 0, 0, 2, 1.0, 0.0, 0))
    too_often = frame(messages.LOG, commands.LOG.pack(192, 42, 0, 0, 2, 0.3, 0.0, 0))
    for data, text in ((unknown, "Requested log does not exist"), (too_often, "Requested rate is invalid"),
                       (frame(19, b""), None), (frame(1, b"short"), "Invalid Message. Field = 1")):  # fmt: skip
        (reply,) = encoder.respond(data)
        acks = decode(reply)
        assert [a.detail for a in acks if isinstance(a, Ack)] == ([text] if text else [])


def test_without_supply_of_the_antenna_there_is_no_solution() -> None:
    encoder = novatel.make_encoder(novatel.Options(unasked=True))
    encoder.respond(novatel.command("antennapower", {"state": "off"}))
    assert not only(encoder.encode(POSITION)[0], Position).valid
    assert "antenna_unpowered" in only(encoder.encode(DeviceStatus(stamp=STAMP, ok=True))[0], DeviceStatus).flags
    encoder.respond(novatel.command("antennapower", {"state": "on"}))
    assert only(encoder.encode(POSITION)[0], Position).valid


def test_time_is_sent_with_the_calendar_of_utc() -> None:
    """GPS 1949, 403742 s is 2017-05-18 16:09:02; UTC is 18 s behind, and the clock 0.25 s ahead."""
    encoder = novatel.make_encoder(novatel.Options(unasked=True))
    encoder.encode(ReceiverClock(stamp=STAMP, offset=0.25, drift=0.0))
    encoder.encode(Reading(stamp=STAMP, name="utc_offset", value=-18.0, unit="s"))
    (data,) = encoder.encode(DeviceTime(stamp=STAMP))
    assert clock.TIME.unpack_from(data, 28)[4:] == (2017, 5, 18, 16, 8, 43_750, 1)
