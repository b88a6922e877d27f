"""iXCOM: commands compared with the maker's package, answers, dialogue with the emulated system."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import ixcom.data
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ixcom.parser import MessageSearcher
from ixcom.protocol import EkfCommand, LogCommand, LogTrigger, Response, XcomCommandParameter

from fti.drivers import imar_ixcom as ix
from fti.drivers.imar_ixcom.commands import COUNTERS, RESPONSES
from fti.drivers.imar_ixcom.options import NUMBERS
from fti.drivers.imar_ixcom.wire import encode_frame
from fti.messages.measurements import (
    Ack,
    Attitude,
    ImuSample,
    Measurement,
    Position,
    Reading,
    Stamp,
    TimeScale,
    Velocity,
)

LAT, LON = 0.84, 0.2


def theirs(number: int, counter: int, extra: str = "", **fields: Any) -> bytes:
    """A command as the maker's package writes it.  extra : format of what its client adds to the payload."""
    message = ixcom.data.getCommandWithID(number)
    message.header.frameCounter = counter
    if extra:
        message.payload.structString += extra
    message.payload.data.update(fields)
    return bytes(message.to_bytes())


def log(counter: int, message: int, trigger: LogTrigger, action: LogCommand, divider: int) -> bytes:
    return theirs(0, counter, messageID=message, trigger=trigger, parameter=action, divider=divider)


# ------------------------------------------------------------------------------------------------------- frames


@pytest.mark.parametrize(
    ("name", "args", "made"),
    [
        ("open_channel", {"channel": "5"}, (5, {"mode": XcomCommandParameter.channel_open, "channelNumber": 5})),
        ("close_channel", {}, (5, {"mode": XcomCommandParameter.channel_close, "channelNumber": 0})),
        ("reboot", {}, (5, {"mode": XcomCommandParameter.reboot})),
        ("align", {}, (4, {"subcommand": EkfCommand.ALIGN})),
        ("complete_alignment", {}, (4, {"subcommand": EkfCommand.ALIGN_COMPLETE})),
        ("save_position", {}, (4, {"subcommand": EkfCommand.SAVEPOS})),
        ("save_heading", {}, (4, {"subcommand": EkfCommand.SAVEHDG})),
        ("save_configuration", {}, (3, {"configAction": 0})),
    ],
)
def test_commands_are_those_of_the_maker(name: str, args: dict[str, str], made: tuple[int, dict[str, Any]]) -> None:
    assert ix.command(name, args) == theirs(made[0], COUNTERS[name], **made[1])


def test_requests_are_those_of_the_maker() -> None:
    """As its client's add_log_sync, add_log_event, poll_log, clear_log and clear_all have them."""
    sync, event, polled = LogTrigger.SYNC, LogTrigger.EVENT, LogTrigger.POLLED
    ask, once, stop = COUNTERS["request_message"], COUNTERS["poll_message"], COUNTERS["stop_message"]
    add, clear = LogCommand.ADD, LogCommand.CLEAR
    imu = {"message": "IMUCORR"}
    assert ix.command("request_message", imu) == log(ask, 1, sync, add, 1)
    assert ix.command("request_message", imu | {"divider": "20"}) == log(ask, 1, sync, add, 20)
    assert ix.command("request_message", {"message": "GNSSSOL", "divider": "0"}) == log(ask, 0x12, event, add, 500)
    assert ix.command("poll_message", imu) == log(once, 1, polled, add, 500)
    assert ix.command("stop_message", imu) == log(stop, 1, sync, clear, 1)
    assert ix.command("stop_all_messages", {}) == log(COUNTERS["stop_all_messages"], 3, sync, LogCommand.CLEAR_ALL, 1)


def test_the_choice_of_status_words_is_a_parameter_of_the_maker() -> None:
    message = ixcom.data.getParameterWithID(803)
    message.header.frameCounter = COUNTERS["status_words"]
    message.payload.data.update(statMode=0x3FF, action=0)
    assert ix.command("status_words", {"mode": "1023"}) == bytes(message.to_bytes())


def test_aiding_with_a_height_is_as_the_client_of_the_maker_does_it() -> None:
    counter, height = COUNTERS["aid_height"], {"height": 123.5, "heightStdDev": 0.25}
    now = theirs(7, counter, "dd", time=0.0, timeMode=1, cmdParamID=6, **height)
    then = theirs(7, counter, "dd", time=345678.25, timeMode=0, cmdParamID=6, **height)
    given = {"height": "123.5", "sd": "0.25"}
    assert ix.command("aid_height", given) == now
    assert ix.command("aid_height", given | {"time": "345678.25"}) == then


def test_an_external_height_is_a_message_of_the_maker() -> None:
    message = ixcom.data.getMessageWithID(0x98)
    message.header.frameCounter = COUNTERS["external_height"]
    message.payload.data.update(time=345678.25, height=123.5, height_stddev=0.25, solution_valid=1)
    given = {"height": "123.5", "sd": "0.25", "time": "345678.25"}
    assert ix.command("external_height", given) == bytes(message.to_bytes())
    assert not ix.COMMANDS["external_height"].answered


@pytest.mark.parametrize(
    ("name", "args", "stated"),
    [
        ("dance", {}, "no command 'dance'; there are external_height, aid_height"),
        ("external_height", {"sd": "1"}, r"external_height: height is missing: above the WGS84 ellipsoid \[m\]"),
        ("external_height", {"height": "1", "sd": "0"}, "sd = '0': must be a number from 0.001 to 10000"),
        ("aid_height", {"height": "nan", "sd": "1"}, "height = 'nan': must be a number from -1000 to 100000"),
        ("aid_height", {"height": "1", "sd": "1", "time": "-1"}, "time = '-1': must be a number from 0 to 604800"),
        ("request_message", {"message": "INSSOLL"}, "request_message: message 'INSSOLL'; there are ACCNED"),
        ("request_message", {"message": "INSSOL", "divider": "1.5"}, "divider = 1.5: must be a whole number from 0"),
        ("request_message", {"message": "INSSOL", "divider": "fast"}, "divider = 'fast': must be a number from 0"),
        ("open_channel", {"channel": "32"}, "channel = '32': must be a number from 0 to 31"),
        ("align", {"now": "1"}, "align: no argument 'now'; allowed: none"),
        ("status_words", {"mode": "1024"}, "mode = '1024': must be a number from 0 to 1023"),
    ],
)
def test_a_wrong_command_is_refused_with_what_is_allowed(name: str, args: dict[str, str], stated: str) -> None:
    with pytest.raises(ValueError, match=stated):
        ix.command(name, args)


@given(st.text(max_size=20), st.dictionaries(st.sampled_from(["height", "sd", "time", "message"]), st.text(max_size=9)))
def test_whatever_is_asked_the_refusal_is_a_value_error(name: str, args: dict[str, str]) -> None:
    for command in (name, *ix.COMMANDS):
        try:
            assert ix.command(command, args)
        except ValueError as error:
            assert str(error)


# ------------------------------------------------------------------------------------------------------ answers


def answer(counter: int, number: int, text: bytes) -> bytes:
    message = ixcom.data.getMessageWithID(0xFE, len(text) + 4)
    message.header.msgID, message.header.frameCounter = 0xFE, counter
    message.payload.data.update(responseID=number, repsonseLength=len(text), responseText=text)
    return bytes(message.to_bytes())


def acks(*data: bytes) -> list[tuple[str, bool, str]]:
    decoder = ix.make_decoder(ix.Options())
    measurements = [m for one in data for m in decoder.feed(one, 1)]
    return [(m.command, m.accepted, m.detail) for m in measurements if isinstance(m, Ack)]


def test_an_answer_says_which_command_it_answers_and_what_became_of_it() -> None:
    rows = acks(answer(COUNTERS["align"], 0, b"OK\0"), answer(COUNTERS["save_heading"], 9, b""), answer(3, 99, b"?"))
    assert rows == [("align", True, "ok"), ("save_heading", False, "out of range"), ("", False, "response 99: ?")]


def test_answers_have_the_numbers_of_the_maker() -> None:
    for response in Response:
        assert RESPONSES[response].replace(" ", "") == response.name.lower()


def test_an_answer_that_is_cut_short_or_not_ascii_is_survived() -> None:
    assert acks(answer(COUNTERS["align"], 0, b"\xff\xfe")) == [("align", True, "ok: ��")]
    short = ix.command("align", {})  # any frame with too small a payload
    assert acks(short) == []


# ----------------------------------------------------------------------------------------------- conversation


def epoch(k: int) -> list[Measurement]:
    stamp = Stamp(k * 10_000_000, 1_391_140_000 * 10**9 + k * 10_000_000, TimeScale.GPS)
    return [
        ImuSample(stamp=stamp, accel_b=(0.0, 0.0, -9.75), gyro_b=(0.0, 0.0, 0.0)),
        Attitude(stamp=stamp, roll=0.0, pitch=0.0, heading=1.0),
        Velocity(stamp=stamp, north=1.0, east=2.0, down=3.0),
        Position(stamp=stamp, lat=LAT, lon=LON, alt=100.0),
    ]


def names(data: Sequence[bytes]) -> list[str]:
    decoder = ix.make_decoder(ix.Options())
    for one in data:
        decoder.feed(one, 1)
    return sorted(decoder.counters.messages.elements())


def flight(encoder: Any, epochs: range) -> list[str]:
    return names([data for k in epochs for m in epoch(k) for data in encoder.encode(m)])


def test_nothing_is_sent_on_connect_unless_it_is_wished() -> None:
    assert ix.on_connect(ix.Options(logs={"INSSOL": 1, "GNSSSOL": 0})) == []


def test_the_emulated_system_is_silent_until_it_is_asked() -> None:
    options = ix.Options(ask=True, logs={"INSSOL": 2, "IMURAW": 1}, channel=3)
    encoder = ix.make_encoder(options)
    assert flight(encoder, range(4)) == []
    answers = [data for requests in ix.on_connect(options) for data in encoder.respond(requests)]
    assert [name for name, _, _ in acks(*answers)] == ["open_channel", "stop_all_messages", *["request_message"] * 2]
    assert all(accepted for _, accepted, _ in acks(*answers))
    assert flight(encoder, range(4, 8)) == ["IMURAW"] * 4 + ["INSSOL"] * 2


def test_messages_are_asked_for_and_stopped() -> None:
    encoder = ix.make_encoder(ix.Options())
    assert flight(encoder, range(2)) == ["INSSOL"] * 2
    for name, args in (
        ("request_message", {"message": "INSRPY", "divider": "2"}),
        ("request_message", {"message": "IMUCORR", "divider": "0"}),
        ("stop_message", {"message": "INSSOL"}),
        ("poll_message", {"message": "INSVELNED"}),
    ):
        assert acks(*encoder.respond(ix.command(name, args))) == [(name, True, "ok")]
    assert flight(encoder, range(2, 6)) == ["IMUCORR"] * 4 + ["INSRPY"] * 2
    encoder.respond(ix.command("close_channel", {}))
    assert flight(encoder, range(6, 9)) == []


def test_answers_have_the_time_of_the_device_as_soon_as_it_knows_one() -> None:
    encoder, decoder = ix.make_encoder(ix.Options()), ix.make_decoder(ix.Options())
    (before,) = decoder.feed(encoder.respond(ix.command("align", {}))[0], 1)
    flight(encoder, range(1, 2))
    (after,) = decoder.feed(encoder.respond(ix.command("align", {}))[0], 1)
    assert (before.stamp.t_dev_ns, after.stamp.t_dev_ns) == (None, epoch(1)[0].stamp.t_dev_ns)


def test_what_cannot_be_done_is_refused() -> None:
    refused = [
        (ix.command("request_message", {"message": "HEAVE"}), "invalid log"),
        (theirs(5, 1, mode=1, channelNumber=77), "invalid channel"),
        (theirs(5, 1)[:-1] + b"\x00", None),  # the checksum does not hold any longer
    ]
    for data, stated in refused:
        encoder = ix.make_encoder(ix.Options())
        assert [detail.split(":")[0] for _, _, detail in acks(*encoder.respond(data))] == ([stated] if stated else [])


@pytest.mark.parametrize("payload", [b"", b"\x00", b"\x00\x00\x00\x00", b"\x05\x00\x00\x00\x01", b"\x63\x00\x00\x00"])
def test_a_command_that_is_none_is_refused(payload: bytes) -> None:
    answers = ix.make_encoder(ix.Options()).respond(encode_frame(NUMBERS["COMMAND"], 1, 0, 0, payload))
    assert [accepted for _, accepted, _ in acks(*answers)] == [False]


@given(st.binary(max_size=60), st.integers(0, 255))
def test_whatever_is_sent_to_it_the_emulated_system_goes_on(payload: bytes, number: int) -> None:
    encoder = ix.make_encoder(ix.Options())
    encoder.respond(payload)
    encoder.respond(encode_frame(number, 1, 0, 0, payload))
    assert encoder.respond(ix.command("align", {}) * 160)  # more than anything that it may wait for


def test_nobody_answers_an_external_height() -> None:
    given = {"height": "123.5", "sd": "0.25"}
    assert ix.make_encoder(ix.Options()).respond(ix.command("external_height", given)) == []


def test_the_package_of_the_maker_reads_what_is_sent() -> None:
    """Its own framing and checksum, and its own table of the message."""
    encoder = ix.make_encoder(ix.Options(logs={"INSSOL": 1, "IMURAW": 1, "INSGNDSPEED": 1, "EXTHEIGHT": 1}))
    sent = [data for k in range(3) for m in epoch(k) for data in encoder.encode(m)]
    height = Reading(stamp=Stamp(1), name="external_height", value=12.5, unit="m")
    sent += encoder.encode(height)
    results: list[bytes] = []
    searcher = MessageSearcher(ignore_c_ext=True)
    searcher.add_callback(lambda data: results.append(bytes(data)))
    searcher.process_bytes(b"".join(sent))
    assert results == sent
    message = ixcom.data.getMessageWithID(NUMBERS["INSSOL"])
    message.from_bytes(next(data for data in results if data[1] == NUMBERS["INSSOL"]))
    assert (message.data["lat"], message.data["lon"], message.data["alt"]) == (LAT, LON, 100.0)
    assert message.data["vel"] == [1.0, 2.0, 3.0]
    message = ixcom.data.getMessageWithID(NUMBERS["EXTHEIGHT"])
    message.from_bytes(results[-1])
    assert (message.data["height"], message.data["solution_valid"]) == (12.5, 1)
