"""Configured lines: templates, fields, checksums, error messages."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti import config
from fti.drivers import ascii_line as al
from fti.drivers._line_template import Template
from fti.errors import ConfigError
from fti.messages.measurements import (
    Attitude,
    Measurement,
    Range,
    Reading,
    Stamp,
    StaticPressure,
    Temperature,
    Velocity,
)

S = Stamp(1)


def options(**table: Any) -> al.Options:
    """The options of a table as it stands in a file; the first line counts, and no line means a lost signal."""
    return config.bind(al.Options, {"first_line": "take", "lost_lines": [], "fields": [], **table}, "a.toml", "options")


def decoded(data: bytes, **table: Any) -> list[Measurement]:
    return al.make_decoder(options(**table)).feed(data, 1)


def values(data: bytes, **table: Any) -> list[float | None]:
    return [m.value for m in decoded(data, **table) if isinstance(m, Reading)]


# ------------------------------------------------------------------------------------------------------- templates


@pytest.mark.parametrize(
    ("spec", "text", "value"),
    [
        (":.2f", "-12.34", -12.34),
        (":f", "12.", 12.0),
        (":f", ".5", 0.5),
        ("", "+7", 7.0),
        (":g", "1.5e-3", 0.0015),
        (":d", "-42", -42.0),
        (":x", "fF", 255.0),
        (":04X", "00ff", 255.0),
        (":7.2f", "  12.34", 12.34),
        (":07.2f", "-012.34", -12.34),
        (":.0f", "130", 130.0),
    ],
)
def test_a_field_is_read(spec: str, text: str, value: float) -> None:
    assert values(f"a={text};\r\n".encode(), line=f"a={{x{spec}}};") == [value]


@pytest.mark.parametrize(
    ("spec", "text"),
    [
        (":.2f", "12.3"),
        (":.2f", "12.345"),
        (":f", "nan"),
        (":f", "1e5"),
        (":f", ""),
        (":f", "."),
        (":d", "1.0"),
        (":d", "1" * 19),
        (":x", "0x1"),
        (":04X", "fff"),
        (":7.2f", "12.34"),
        (":07.2f", "12.34"),
        (":.0f", "130."),
        (":f", " 1"),
    ],
)
def test_what_is_written_otherwise_is_another_line(spec: str, text: str) -> None:
    decoder = al.make_decoder(options(line=f"a={{x{spec}}};"))
    assert decoder.feed(f"a={text};\r\n".encode(), 1) == []
    assert decoder.counters.skipped["other_line"] == len(text) + 4


def test_a_fixed_width_shows_a_lost_digit() -> None:
    """Of "130.00" the end is a good "30.00"; where the width is said it is none."""
    assert values(b"130.00\r\n30.00\r\n", line="{x:06.2f}") == [130.0]


@given(st.text(max_size=40), st.text(max_size=200))
def test_any_template_is_refused_in_a_sentence_or_reads_what_it_writes(text: str, line: str) -> None:
    try:
        template = Template(text)
    except ValueError as error:
        assert str(error).startswith("line: ")
        return
    template.match(line.encode("utf-8"))
    values: dict[str, Any] = {p.name: "a" * (p.width or 1) if p.kind == "s" else 3.0 for p in template.fields}
    assert template.match(template.write(values))


def test_fields_that_would_give_characters_back_to_one_another_are_refused() -> None:
    """Twenty numbers with a 1 between them could share a line of ones in 10^20 ways; no field gives anything back."""
    with pytest.raises(ValueError, match="cannot be separated from the next"):
        Template("1".join(f"{{x{i}:d}}" for i in range(20)) + "!")
    template = Template(",".join(f"{{x{i}:f}}" for i in range(20)) + "!")
    assert template.match(b",".join([b"111111111111111"] * 20) + b"?") is None


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("plain", "line: has no {field}"),
        ("{a:d} {a:d}", "line: 'a' occurs twice"),
        ("{A:d}", "small letters"),
        ("{0}", "small letters"),
        ("{a!r}", "small letters"),
        ("{a:.2e}", "must be like f, .2f"),
        ("{a:.2d}", "must be like f, .2f"),
        ("{a:08s}", "must be like f, .2f"),
        ("{a:d}{b:d}", "cannot be separated from the next one"),
        ("{a:s}{b:d}", "cannot be separated from the next one"),
        ("{a", "line: expected '}'"),
        ("{a:d}\u20ac", "line: 'latin-1' codec can't encode"),
        ("{a:d}\r", "contains a character of the terminator"),
        ("{_a:d}", "none becomes a measurement"),
        ("{a:d}*{checksum:02X}", "checksum: must be configured"),
    ],
)
def test_a_wrong_template_is_one_sentence(line: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence.replace("{", r"\{").replace("(", r"\(")):
        al.make_decoder(options(line=line))


# ---------------------------------------------------------------------------------------------------------- fields


def test_a_quantity_is_sent_in_its_unit_and_becomes_si() -> None:
    """1013.25 hPa, 15 degC and 100 kt, by hand: 101325 Pa, 288.15 K, 51.4444 m/s."""
    fields = [
        {"name": "static_pressure", "unit": "hPa"},
        {"name": "static_air_temperature", "unit": "degC"},
        {"name": "ground_speed", "unit": "kt"},
    ]
    line = "{static_pressure:.2f},{static_air_temperature:.1f},{ground_speed:.1f}"
    measurements = decoded(b"1013.25,15.0,100.0\r\n", line=line, fields=fields)
    assert measurements[0] == StaticPressure(stamp=S, p_static=101_325.0)
    assert isinstance(measurements[1], Temperature)
    assert measurements[1].static == pytest.approx(288.15)
    assert isinstance(measurements[2], Velocity)
    assert measurements[2].ground_speed == pytest.approx(51.4444, abs=1e-4)


def test_scale_and_offset_come_before_the_unit() -> None:
    """A raw count of 1000 with 0.1 and -40 is 60 deg, and 60 deg are 1.0472 rad."""
    fields = [{"name": "raw_pitch", "quantity": "pitch", "unit": "deg", "scale": 0.1, "offset": -40.0}]
    (found,) = decoded(b"1000\r\n", line="{raw_pitch:d}", fields=fields)
    assert isinstance(found, Attitude)
    assert found.pitch == pytest.approx(1.047198, abs=1e-6)


@pytest.mark.parametrize("text", ["-1.00", "130.00", "///", "E15"])
def test_a_lost_signal_is_not_a_value(text: str) -> None:
    fields = [{"name": "slant_range", "lost": [-1.0, 130, "///", "E15"]}]
    measurements = decoded(f"{text}\r\n12.50\r\n".encode(), line="{slant_range:.2f}", fields=fields)
    assert measurements == [Range(stamp=S, slant_range=None, valid=False), Range(stamp=S, slant_range=12.5)]


def test_lines_may_mean_that_there_is_no_measurement() -> None:
    table = {"line": "{slant_range:.2f} {level:d}", "lost_lines": ["E{_:d}", "no target"], "fields": []}
    decoder = al.make_decoder(options(**table))
    measurements = decoder.feed(b"E15\r\nno target\r\nno targets\r\n1.00 5\r\n", 1)
    assert [m.valid for m in measurements if isinstance(m, Range)] == [False, False, True]
    assert [m.valid for m in measurements if isinstance(m, Reading)] == [False, False, True]
    assert decoder.counters.messages == {"lost_line": 2, "line": 1}
    assert decoder.counters.skipped == {"other_line": 11}


def test_a_line_for_lost_wins_over_the_template_that_it_is_like() -> None:
    table = {"line": "{slant_range:f}", "lost_lines": ["130.00", "{_:d}.0"]}
    decoder = al.make_decoder(options(**table))
    measurements = decoder.feed(b"130.00\r\n7.0\r\n7.5\r\n", 1)
    assert [m.slant_range for m in measurements if isinstance(m, Range)] == [None, None, 7.5]
    assert decoder.counters.messages == {"lost_line": 2, "line": 1}


@pytest.mark.parametrize(
    ("spec", "lost", "text"),
    [
        (".2f", "130.00", "130.00"),
        ("04X", "FFFF", "FFFF"),
        ("04x", "FFFF", "ffff"),
        ("d", "-1", "-1"),
        ("f", 130, "130.00"),
    ],
)
def test_a_lost_number_may_be_written_in_quotes(spec: str, lost: object, text: str) -> None:
    """Quoted as the device prints it, or as a number: it is lost however it is written."""
    fields = [{"name": "slant_range", "lost": [lost]}]
    measurements = decoded(f"{text}\r\n".encode(), line=f"{{slant_range:{spec}}}", fields=fields)
    assert measurements == [Range(stamp=S, slant_range=None, valid=False)]


def test_a_word_for_lost_may_begin_a_number_and_need_not_fill_the_width() -> None:
    fields = [{"name": "x", "lost": ["-", "/", "E"]}]
    assert values(b"-\r\n-0.5\r\nE\r\n", line="{x:.1f}", fields=fields) == [None, -0.5, None]
    assert values(b"-,1\r\n-5,1\r\n", line="{x:d},1", fields=fields) == [None, -5.0]
    assert values(b"/m\r\n    /m\r\n  1.0m\r\n 1.0m\r\n", line="{x:5.1f}m", fields=fields) == [None, None, 1.0]
    assert values(b"/F\r\n1.0F\r\n", line="{x:.1f}{_u:1s}", fields=fields) == [None, 1.0]


def test_a_negative_distance_pressure_or_temperature_is_none() -> None:
    for name, unit in (("slant_range", "m"), ("dme_1_distance", "NM"), ("static_air_temperature", "K")):
        (found,) = decoded(b"-1.0\r\n", line="{x:f}", fields=[{"name": "x", "quantity": name, "unit": unit}])
        assert not found.valid  # type: ignore[union-attr]
    assert decoded(b"-0.1\r\n", line="{static_pressure:f}") == []
    fields = [{"name": "x", "quantity": "static_air_temperature", "unit": "degC"}]
    (cold,) = decoded(b"-40.0\r\n", line="{x:f}", fields=fields)
    assert isinstance(cold, Temperature)
    assert cold.static == pytest.approx(233.15)


def test_what_a_needed_field_needs_is_needed_too() -> None:
    fields = [
        {"name": "slant_range", "needs": ["level"]},
        {"name": "level", "needs": ["_state"]},
        {"name": "_state", "good": [1], "needs": ["slant_range"]},
    ]
    measurements = decoded(b"9.0,5,1\r\n9.0,5,0\r\n", line="{slant_range:f},{level:d},{_state:d}", fields=fields)
    assert [m.valid for m in measurements] == [True, True, False, False]  # type: ignore[union-attr]


def test_the_fields_of_the_default_are_those_of_its_line() -> None:
    own = config.bind(al.Options, {"line": "T={temperature:f}", "first_line": "take"}, "a.toml", "options")
    assert al.make_decoder(own).feed(b"T=21.5\r\n", 1) == [Reading(stamp=S, name="temperature", value=21.5)]
    model = config.bind(al.Options, {"line": "D {slant_range:.2f}", "first_line": "take"}, "a.toml", "options")
    assert al.make_decoder(model).feed(b"D 130.00\r\n", 1) == [Range(stamp=S, slant_range=None, valid=False)]


def test_limits_good_words_and_needs_decide_on_validity() -> None:
    table = {
        "line": "{slant_range:.2f},{level:d},{_state:1s}",
        "fields": [
            {"name": "slant_range", "needs": ["level", "_state"]},
            {"name": "level", "limits": [100, 500]},
            {"name": "_state", "good": ["A", "D"]},
        ],
    }
    measurements = decoded(b"9.00,100,A\r\n9.00,99,A\r\n9.00,501,D\r\n9.00,200,V\r\n9.00,500,D\r\n", **table)
    assert [m.valid for m in measurements if isinstance(m, Range)] == [True, False, False, False, True]
    assert [m.valid for m in measurements if isinstance(m, Reading)] == [True, False, False, True, True]
    assert all(m.valid or m.slant_range is None for m in measurements if isinstance(m, Range))


def test_what_cannot_be_without_a_value_is_not_sent_when_there_is_none() -> None:
    """A pressure of nothing does not exist; the line is counted all the same."""
    table = {"line": "{static_pressure:.1f}", "fields": [{"name": "static_pressure", "unit": "hPa", "lost": [0]}]}
    decoder = al.make_decoder(options(**table))
    assert decoder.feed(b"0.0\r\n", 1) == []
    assert decoder.counters.messages == {"line": 1}


def test_characters_are_a_reading_too() -> None:
    table = {"line": "{model:s},{state:d}"}
    measurements = decoded(b"SF11,2\r\n", **table)
    assert measurements[0] == Reading(stamp=S, name="model", value=None, text="SF11")
    named = Reading(stamp=S, name="state", value=2.0, text="tracking")  # a number that has a name is sent as a number
    encoder = al.make_encoder(options(**table))
    assert encoder.encode(measurements[0]) + encoder.encode(named) == [b"SF11,2\r\n"]


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ([{"name": "y"}], "fields: 'y' is not in the message; there are x"),
        ([{"name": "x", "quantity": "hight"}], "fields: x: quantity 'hight'; there are radio_height"),
        ([{"name": "x", "quantity": "radio_height", "unit": "hPa"}], "radio_height: unit 'hPa'; allowed here: m, ft"),
        ([{"name": "x", "scale": 0}], "fields: x: scale = 0; must not be 0"),
        ([{"name": "x", "limits": [5, 1]}], "fields: x: limits = [5.0, 1.0]; the first must be below"),
        ([{"name": "x", "needs": ["z"]}], "fields: x: needs 'z', which is not in the message"),
        ([{"name": "x"}, {"name": "x"}], "fields: 'x' is described twice"),
        ([{"name": "x", "lost": [130.5]}], "fields: x: lost: 130.5 does not fit into {x:d}"),
        ([{"name": "x", "good": [0.1]}], "fields: x: good: 0.1 does not fit into {x:d}"),
    ],
)
def test_a_wrong_field_is_one_sentence(fields: list[dict[str, Any]], sentence: str) -> None:
    with pytest.raises(ValueError) as caught:
        al.make_decoder(options(line="{x:d}", fields=fields))
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"lines": "{x:d}"}, "a.toml: options.lines: there is no such key; allowed here: checksum, fields"),
        ({"fields": [{"name": "x", "unti": "m"}]}, "options.fields[0].unti: there is no such key; allowed here: good"),
        ({"longest": 4096}, "a.toml: options.longest = 4096: input should be less than or equal to 2048"),
        ({"checksum": {"kind": "crc9"}}, "a.toml: options.checksum.kind = 'crc9': input should be 'xor8'"),
        ({"poll": {"every_s": 0, "send": "d"}}, "options.poll.every_s = 0: input should be greater than 0"),
    ],
)
def test_a_wrong_key_is_one_sentence_with_file_and_place(table: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ConfigError) as caught:
        options(**table)
    assert sentence in str(caught.value)


# ------------------------------------------------------------------------------------------------------- checksums


def test_the_checksum_of_a_real_sentence_holds_and_a_changed_one_does_not() -> None:
    """A sentence of a u-blox receiver, from a test capture of gpsd."""
    table = {
        "line": "$GNVTG,,T,,M,{ground_speed:.3f},N,{_km_h:.3f},K,{_mode:1s}*{checksum:02X}",
        "checksum": {"kind": "xor8", "after": "$", "before": "*"},
    }
    sentence = b"$GNVTG,,T,,M,0.039,N,0.072,K,D*37\r\n"
    assert len(decoded(sentence, **table)) == 1
    decoder = al.make_decoder(options(**table))
    for at in range(13, 17):
        changed = bytearray(sentence)
        changed[at] ^= 1
        assert decoder.feed(bytes(changed), 1) == []
    assert decoder.counters.skipped["bad_checksum"] == 3 * (len(sentence) - 1)
    assert decoder.counters.skipped["other_line"] == len(sentence) - 1  # there the point became a slash


@pytest.mark.parametrize("kind", ["xor8", "sum8", "sum16", "crc16_modbus", "crc16_xmodem", "crc32"])
def test_a_line_with_its_checksum_goes_there_and_back(kind: str) -> None:
    table = {"line": "#{x:.3f};{checksum:X}", "checksum": {"kind": kind, "after": "#"}}
    encoder = al.make_encoder(options(**table))
    (line,) = encoder.encode(Reading(stamp=S, name="x", value=-1.5))
    assert values(line, **table) == [-1.5]
    assert values(line.replace(b"1", b"2", 1), **table) == []


# ----------------------------------------------------------------------------------------------------- lines, sending


@pytest.mark.parametrize(
    ("line", "fields", "sentence"),
    [
        ("{x:s}", [{"name": "x", "lost": [9]}], "x: lost: 9 is a number, but the field is text"),
        ("{x:s}", [{"name": "x", "limits": [0, 9]}], "fields: x: is text in the line"),
        ("{slant_range:s}", [], "fields: slant_range: is text in the line"),
        ("{x:04X}", [{"name": "x", "lost": [-1]}], "x: lost: -1 does not fit into {x:04X}"),
        ("{x:.1f}", [{"name": "x", "lost": [0.25]}], "x: lost: 0.25 does not fit into {x:.1f}"),
    ],
)
def test_a_word_that_the_device_cannot_send_is_one_sentence(
    line: str, fields: list[dict[str, Any]], sentence: str
) -> None:
    with pytest.raises(ValueError) as caught:
        al.make_decoder(options(line=line, fields=fields))
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"on_connect": ["€"]}, "on_connect = '€': each character must be one byte"),
        ({"poll": {"every_s": 1, "send": "€"}}, "poll.send = '€': each character must be one byte"),
        ({"terminator": "€"}, "terminator = '€': each character must be one byte"),
        ({"longest": 8, "line": "AAAAAAAA{x:d}"}, "longest = 8: a line with its end has at least 10 characters"),
        ({"lost_lines": ["{x"]}, "lost_lines: '{x': expected '}'"),
    ],
)
def test_what_cannot_be_sent_or_read_is_one_sentence(table: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError) as caught:
        al.make_decoder(options(**{"line": "{x:d}", **table}))
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("spec", "rule", "sentence"),
    [
        (":s", {}, "checksum: xor8 needs the format {checksum:02X}, 02x or d"),
        ("", {}, "checksum: xor8 needs the format"),
        (":02X", {"kind": "crc16_modbus"}, "checksum: crc16_modbus needs the format {checksum:04X}"),
        (":02X", {"after": "!"}, "checksum: after = '!': must be in the line before the checksum"),
        (":02X", {"before": ";"}, "checksum: before = ';': must be in the line before the checksum"),
    ],
)
def test_a_checksum_that_no_line_can_have_is_one_sentence(spec: str, rule: dict[str, str], sentence: str) -> None:
    checksum = {"kind": "xor8", "after": "$", "before": "*", **rule}
    with pytest.raises(ValueError) as caught:
        al.make_decoder(options(line=f"${{x:d}}*{{checksum{spec}}}", checksum=checksum))
    assert sentence in str(caught.value)


def test_a_checksum_may_be_decimal() -> None:
    table = {"line": "{x:d};{checksum:d}", "checksum": {"kind": "sum8", "before": ";"}}
    assert values(b"12;99\r\n12;98\r\n12;153\r\n", line=table["line"], checksum=table["checksum"]) == [12.0]


def test_the_first_line_is_not_taken_unless_it_is_known_to_be_whole() -> None:
    decoder = al.make_decoder(al.Options())
    assert decoder.feed(b"30.00\r\n12.00\r\n", 1) == [Range(stamp=S, slant_range=12.0)]
    assert decoder.counters.skipped == {"no_beginning": 6}


@pytest.mark.parametrize("text", ["130.00", "160.0", "230", "250.00", "0.00", "-1.00", "500.01", "E15"])
def test_what_is_assumed_of_the_ilm_500_takes_no_lost_signal_for_a_range(text: str) -> None:
    measurements = al.make_decoder(al.Options()).feed(f"\r\n{text}\r\n129.99\r".encode(), 1)
    assert measurements == [Range(stamp=S, slant_range=None, valid=False), Range(stamp=S, slant_range=129.99)]


def test_other_terminators() -> None:
    table = {"line": "\x02{x:d}", "terminator": "\x03"}
    assert values(b"\x021\x03\x022\r\x03\x023\x03", **table) == [1.0, 3.0]
    (sent,) = al.make_encoder(options(**table)).encode(Reading(stamp=S, name="x", value=4.0))
    assert sent == b"\x024\x03"


def test_a_line_that_is_too_long_is_left_behind() -> None:
    decoder = al.make_decoder(options(line="{x:d}", longest=16))
    measurements = decoder.feed(b"1" * 100 + b"\r\n5\r\n", 1)
    assert [m.value for m in measurements if isinstance(m, Reading)] == [5.0]
    assert decoder.counters.skipped == {"too_long": 96, "no_beginning": 5}


def test_bytes_that_are_no_characters_are_distinguished_from_other_lines() -> None:
    decoder = al.make_decoder(options(line="{x:d}"))
    decoder.feed(b"hello\r\n\xff\x00\r\n", 1)
    assert decoder.counters.skipped == {"other_line": 6, "no_match": 3}


def test_a_line_goes_out_when_every_field_was_set_again() -> None:
    encoder = al.make_encoder(options(line="{x:.1f},{y:d},{_z:d}", fields=[{"name": "_z", "good": [7]}]))
    reported = [("x", 1.0), ("x", 2.0), ("y", 3.0), ("y", 4.0), ("z", 1.0), ("x", 5.0)]
    sent = [encoder.encode(Reading(stamp=S, name=name, value=value)) for name, value in reported]
    assert [line for lines in sent for line in lines] == [b"2.0,3,7\r\n", b"5.0,4,7\r\n"]


def test_what_the_device_has_no_word_for_is_not_sent() -> None:
    lost = Range(stamp=S, slant_range=None, valid=False)
    assert al.make_encoder(options(line="{slant_range:.2f}")).encode(lost) == []
    fields = [{"name": "slant_range", "lost": ["---"]}]
    assert al.make_encoder(options(line="{slant_range:.2f}", fields=fields)).encode(lost) == [b"---\r\n"]
    wrong = Range(stamp=S, slant_range=20.0, valid=False)
    assert al.make_encoder(options(line="{slant_range:.2f}", fields=fields)).encode(wrong) == [b"---\r\n"]


def test_a_device_that_is_asked() -> None:
    requests = options(line="{x:d}", poll={"every_s": 0.5, "send": "?\r\n"}, on_connect=["mode=1\r\n"])
    assert al.poll(requests) == (0.5, b"?\r\n")
    assert al.on_connect(requests) == [b"mode=1\r\n"]
    encoder = al.make_encoder(requests)
    assert encoder.encode(Reading(stamp=S, name="x", value=1.0)) == []
    assert encoder.respond(b"?\r\n") == [b"1\r\n"]


def test_a_line_can_be_sent() -> None:
    assert al.command("send", {"text": "0R2"}) == b"0R2\r\n"
    assert al.command("send", {"text": "x"}, options(line="{x:d}", terminator="\r")) == b"x\r"
    for args in ({}, {"text": ""}, {"text": "a\r\n"}, {"text": "\u00e9"}, {"text": "x" * 257}, {"text": "a", "b": "c"}):
        with pytest.raises(ValueError, match="send: "):
            al.command("send", args)


@given(st.lists(st.binary(max_size=60), max_size=10))
def test_garbage_makes_no_valid_value_without_its_checksum(pieces: list[bytes]) -> None:
    table = {"line": "${x:.2f}*{checksum:04X}", "checksum": {"kind": "crc16_xmodem", "after": "$", "before": "*"}}
    assert decoded(b"\r\n".join(pieces), **table) == []
