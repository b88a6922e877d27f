"""Label sets: every label of every built-in set over its whole range, user sets, invalid sets."""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti import config
from fti.config import bind
from fti.devices import bind_devices
from fti.drivers import arinc429
from fti.drivers.arinc429 import word as wire
from fti.drivers.arinc429.label_codec import NumberLabel, make_codecs
from fti.drivers.arinc429.labels import Label, LabelSet, built_in_sets, choose, read_sets
from fti.drivers.arinc429.word import BnrState, DiscreteState
from fti.errors import ConfigError
from fti.formats.quantities import DIMENSIONS, QUANTITIES, UNITS
from fti.messages.measurements import (
    Deviation,
    DeviceStatus,
    DmeRange,
    Measurement,
    Position,
    RadioHeight,
    Reading,
    Stamp,
    TimeScale,
    Velocity,
)
from fti.ranging.radar.quantise import quantisation_step_ft

FOOT = 0.3048
S = Stamp(7)
NUMBERS = [
    pytest.param(label, id=f"{name}-{label.label}")
    for name, found in built_in_sets().items()
    for label in found.labels
    if label.kind != "discrete"
]
DISCRETES = [label for found in built_in_sets().values() for label in found.labels if label.kind == "discrete"]


def to_si(label: Label) -> tuple[float, float]:
    return UNITS.get(label.unit, (1.0, 0.0))


def measured(label: Label, value: float) -> Measurement:
    """The measurement that carries this value of the wire, made from the classes and not from the driver."""
    factor, offset = to_si(label)
    if label.reading:
        si = next((group[0] for group in DIMENSIONS if label.unit in group), label.unit)
        return Reading(stamp=S, name=label.reading, value=value * factor + offset, unit=si)
    quantity = QUANTITIES[label.quantity]
    si_value = (value * factor + offset) * quantity.sign
    measurement: Measurement = quantity.measurement(stamp=S, **dict(quantity.constant), **{quantity.field: si_value})
    return measurement


def value_of(label: Label, measurement: Measurement) -> float:
    """The value in the unit of the wire."""
    factor, offset = to_si(label)
    sign = 1 if label.reading else QUANTITIES[label.quantity].sign
    field = "value" if label.reading else QUANTITIES[label.quantity].field
    value: float = getattr(measurement, field)
    return (value * sign - offset) / factor


def there_and_back(label: Label, value: float) -> float:
    (entry,) = make_codecs(LabelSet(labels=(label,)))
    decode = {handler.label: handler.decode for handler in entry.handlers()}
    words = entry.encode(measured(label, value))
    assert all(wire.is_intact(word) for word in words)
    (found,) = [m for word in words for m in decode[wire.label_octal(word)](word, S)]
    assert getattr(found, "valid", True)
    return value_of(label, found)


def resolution(label: Label) -> float:
    if label.kind == "bcd":
        return label.resolution or 0.0
    return math.ldexp(label.range or 0.0, -(label.bits or 0) - (label.fine_bits if label.fine_label else 0))


def ends(label: Label) -> tuple[float, float]:
    if label.kind == "bcd":
        top = 79_999 * (label.resolution or 0.0)
        return (0.0 if label.quantity in ("radio_height", "dme_1_distance") else -top), top
    top = label.range or 0.0
    return -top, top - resolution(label)


def off_by(label: Label, measurements: float, value: float) -> float:
    turns = label.unit == "deg" and label.range == 180.0
    return abs(math.remainder(measurements - value, 360.0)) if turns else abs(measurements - value)


@pytest.mark.parametrize("label", NUMBERS)
def test_every_label_comes_back_to_half_a_bit_over_its_whole_range(label: Label, scale: int) -> None:
    low, high = ends(label)
    if label.steps:
        low, high = 0.0, 8000.0  # an instrument with steps shows nothing below the ground

    def check(value: float) -> None:
        half = (quantisation_step_ft(value) if label.steps else resolution(label)) / 2
        slack = 1e-9 * max(abs(low), abs(high))  # of floating point, on the way through SI
        assert off_by(label, there_and_back(label, value), value) <= half + slack

    for edge in (low, -resolution(label), 0.0, resolution(label), high):
        check(min(max(edge, low), high))
    anywhere = random.Random(label.label)
    for _ in range(30 * scale):
        check(anywhere.uniform(low, high))


@pytest.mark.parametrize("label", NUMBERS)
def test_beyond_its_range_a_label_saturates_and_an_angle_turns(label: Label) -> None:
    low, high = ends(label)
    if label.steps:
        return
    if label.unit == "deg" and label.range == 180.0:
        for value, measurements in ((180.0, -180.0), (270.0, -90.0), (359.0, -1.0), (-190.0, 170.0)):
            assert off_by(label, there_and_back(label, value), measurements) <= resolution(label)
        return
    slack = 1e-9 * high
    assert there_and_back(label, 1.5 * high) == pytest.approx(high, abs=slack)
    if low < 0:
        assert there_and_back(label, 1.5 * low) == pytest.approx(low, abs=slack)


@pytest.mark.parametrize("label", NUMBERS)
@pytest.mark.parametrize("state", [BnrState.FAILURE, BnrState.NO_COMPUTED_DATA])
def test_no_label_makes_a_valid_number_of_what_the_equipment_does_not_vouch_for(label: Label, state: BnrState) -> None:
    if label.kind == "bcd" and state == BnrState.FAILURE:
        return  # 0 is plus
    (entry,) = make_codecs(LabelSet(labels=(label,)))
    word = wire.encode_steps(label.label, 1 << 3, label.bits or 18, state=state)
    found = entry.handlers()[0].decode(word, S)
    numbers = [m for m in found if not isinstance(m, DeviceStatus)]
    assert [m for m in found if isinstance(m, DeviceStatus) and not m.ok]
    assert not any(getattr(m, "valid", True) for m in numbers)
    assert all(value is None for m in numbers for value in [getattr(m, "value", None)])


@pytest.mark.parametrize("label", DISCRETES, ids=lambda label: label.label)
@given(st.data())
def test_every_bit_of_a_discrete_word_comes_back(label: Label, data: st.DataObject) -> None:
    flags = tuple(name for name in label.flags if data.draw(st.booleans()))
    sizes = {name: bits[1] - bits[0] + len(bits) - 1 for name, bits in label.fields.items()}
    fields = {name: data.draw(st.integers(0, 2**size - 1)) for name, size in sizes.items()}
    (entry,) = make_codecs(LabelSet(labels=(label,)))
    sent: list[Measurement] = [Reading(stamp=S, name=name, value=float(value)) for name, value in fields.items()]
    sent.append(DeviceStatus(stamp=S, ok=True, flags=flags))
    (word,) = [word for m in sent for word in entry.encode(m)]
    assert entry.handlers()[0].decode(word, S) == sent


@pytest.mark.parametrize("name", list(built_in_sets()))
def test_every_built_in_set_says_where_it_is_from_and_who_sends_it(name: str) -> None:
    label_set = built_in_sets()[name]
    assert len(label_set.source) > 15
    assert label_set.equipment
    assert make_codecs(label_set)


def test_a_twenty_bit_label_takes_the_bits_of_the_sdi_and_an_other_one_keeps_it() -> None:
    long = Label(label="310", quantity="latitude", unit="deg", range=180.0, bits=20)
    (word,) = NumberLabel(long).encode(Position(stamp=S, lat=math.radians(180.0 * 3 / 2**20)))
    assert (word >> 8 & 3) == 3
    short = Label(label="164", quantity="radio_height", unit="ft", range=8192.0, bits=16, sdi=2)
    (word,) = NumberLabel(short).encode(RadioHeight(stamp=S, height_agl=100.0))
    assert (word >> 8 & 3) == 2


# ------------------------------------------------------------------------------------- the same label, elsewhere


HEIGHT_165 = wire.encode_bcd("165", 1234.5, 0.1, state=wire.BcdState.PLUS)
CLIMB_165 = wire.encode_bnr("165", 1500.0, 32768.0, 15, state=BnrState.NORMAL)

CONFIGURATION = """
[session]
name = "two"
directory = "data"

[[link]]
name = "altimeter_line"
kind = "serial"
port = "/dev/ttyUSB0"
baud = 115200

[[link]]
name = "gps_line"
kind = "udp"
bind = "127.0.0.1:47440"

[[device]]
name = "altimeter"
link = "altimeter_line"
driver = "arinc429"
options = { set = "radio_altimeter_bcd" }

[[device]]
name = "gps"
link = "gps_line"
driver = "arinc429"
options = { set = "our_gps", labels_file = "our_labels.toml", packets = "apmp", bus = 2 }
"""

OUR_LABELS = """
[our_gps]
equipment = "00B"
source = "a test"
labels = [
    { label = "165", quantity = "vertical_speed", unit = "ft/min", range = 32768.0, bits = 15 },
    { label = "271", kind = "discrete", name = "panel", flags = { gear_down = 11, test = 12 }, not_ok = ["test"] },
]
"""


def test_one_configuration_reads_label_165_as_a_height_and_as_a_vertical_speed(tmp_path: Path) -> None:
    (tmp_path / "two.toml").write_text(CONFIGURATION)
    (tmp_path / "our_labels.toml").write_text(OUR_LABELS)
    altimeter, gps = bind_devices(config.load(tmp_path / "two.toml"))
    results = altimeter.make_decoder().feed(HEIGHT_165.to_bytes(4, "big") * 3, 1)
    assert isinstance(results[0], RadioHeight)
    assert results[0].height_agl == pytest.approx(1234.5 * FOOT)
    sent = gps.driver.make_encoder(gps.options).encode(Velocity(stamp=S, down=-1500.0 * FOOT / 60))
    assert int.from_bytes(sent[0][-4:], "big") == CLIMB_165
    (measurements,) = gps.make_decoder().feed(sent[0], 1)
    assert isinstance(measurements, Velocity)
    assert measurements.down == pytest.approx(-7.62)


def test_labels_beside_a_file_of_labels_are_not_lost_without_a_word(tmp_path: Path) -> None:
    both = CONFIGURATION.replace('set = "our_gps",', 'set = "our_gps", labels = [],')
    (tmp_path / "two.toml").write_text(both)
    (tmp_path / "our_labels.toml").write_text(OUR_LABELS)
    with pytest.raises(ConfigError, match=r"device\[1\].options: labels and labels_file: only one of them is allowed"):
        bind_devices(config.load(tmp_path / "two.toml"))


def test_the_equipment_that_sends_is_compared_with_the_one_of_the_set() -> None:
    decoder = arinc429.make_decoder(arinc429.Options(set="radio_altimeter_bcd"))
    words = [HEIGHT_165, HEIGHT_165, wire.encode_discrete("377", 0x00B << 10, state=DiscreteState.NORMAL)]
    measurements = decoder.feed(b"".join(word.to_bytes(4, "big") for word in words), 1)
    assert Reading(stamp=Stamp(1), name="equipment_id", value=11.0) in measurements
    assert measurements[-1] == DeviceStatus(stamp=Stamp(1), ok=False, flags=("equipment_00B_instead_of_007",))


def test_a_discrete_word_names_what_is_set_and_what_is_not_normal() -> None:
    (entry, _) = make_codecs(choose("our_gps", OUR_LABELS).model_copy(update={"labels": DISCRETE_ONLY}))
    decode = entry.handlers()[0].decode

    def word(data: int, state: DiscreteState) -> int:
        return wire.encode_discrete("271", data, state=state)

    def status(ok: bool, *flags: str) -> list[Measurement]:
        return [DeviceStatus(stamp=S, ok=ok, flags=flags)]

    assert decode(word(1 << 10, DiscreteState.NORMAL), S) == status(True, "gear_down")
    assert decode(word(3 << 10, DiscreteState.NORMAL), S) == status(False, "gear_down", "test")
    assert decode(word(1 << 10, DiscreteState.FUNCTIONAL_TEST), S) == status(
        False, "gear_down", "panel_functional_test"
    )
    assert decode(word(3 << 10, DiscreteState.FAILURE), S) == status(False, "panel_failure")
    for state in DiscreteState:
        (found,) = decode(word(1 << 10, state), S)
        (again,) = entry.encode(found)
        assert decode(again, S) == [found]
    assert entry.encode(DeviceStatus(stamp=S, ok=False, flags=("of_another_device",))) == []


DISCRETE_ONLY = (
    Label(label="271", kind="discrete", name="panel", flags={"gear_down": 11, "test": 12}, not_ok=("test",)),
)


def test_the_fine_word_goes_on_where_the_coarse_one_ends() -> None:
    """-33.9461234 deg is -404993027 steps of 180/2^31 deg: -197751 times 2048, and 1021."""
    label = built_in_sets()["gnss_743a"].labels[4]
    (entry,) = make_codecs(LabelSet(labels=(label,)))
    coarse, fine = entry.encode(Position(stamp=S, lat=math.radians(-33.9461234)))
    assert (wire.decode_steps(coarse, 20), wire.decode_steps(fine, 11)) == (-197751, 1021)
    decode_coarse, decode_fine = (handler.decode for handler in entry.handlers())
    assert decode_coarse(coarse, S) == []
    (found,) = decode_fine(fine, Stamp(9))
    assert isinstance(found, Position)
    assert found.stamp == S
    assert found.lat == pytest.approx(math.radians(-33.9461234), abs=math.radians(180 / 2**32))
    assert decode_fine(fine, S) == []


def test_a_fine_word_of_another_coarse_word_makes_no_position() -> None:
    """The coarse word before it was lost, or follows it: the position would be up to 19 m off, and look right."""
    (entry,) = make_codecs(LabelSet(labels=(built_in_sets()["gnss_743a"].labels[4],)))
    decode_coarse, decode_fine = (handler.decode for handler in entry.handlers())
    coarse, fine = entry.encode(Position(stamp=S, lat=math.radians(48.1)))
    too_late = (DeviceStatus(stamp=Stamp(1_000_000_001), ok=False, flags=("latitude_fine_too_late",)),)
    assert decode_coarse(coarse, Stamp(1)) == []
    assert tuple(decode_fine(fine, Stamp(1_000_000_001))) == too_late
    in_packets = Stamp(5, 1_000_000_000, TimeScale.BOOT), Stamp(5, 1_200_000_000, TimeScale.BOOT)
    assert decode_coarse(coarse, in_packets[0]) == []
    assert [m.stamp for m in decode_fine(fine, in_packets[1]) if isinstance(m, DeviceStatus)] == [in_packets[1]]
    assert decode_coarse(coarse, Stamp(1)) == []
    assert isinstance(decode_fine(fine, Stamp(100_000_001))[0], Position)


def test_satellites_beyond_fifteen_are_counted() -> None:
    """Esterline CMA-5024, label 273: visible in bits 16-19, its highest bit is bit 11; used in 20-23 and 29."""
    (entry,) = make_codecs(LabelSet(labels=tuple(x for x in built_in_sets()["gnss_743a"].labels if x.label == "273")))
    data = 0b0001 << 15 | 1 << 10 | 0b1100 << 19 | 0b01100 << 23
    word = wire.encode_discrete("273", data, state=DiscreteState.NORMAL)
    found = entry.handlers()[0].decode(word, S)
    assert [(m.name, m.value) for m in found if isinstance(m, Reading)] == [
        ("satellites_visible", 17.0), ("satellites_used", 12.0), ("gnss_mode", 12.0),
    ]  # fmt: skip


@pytest.mark.parametrize("order", [1, -1])
def test_the_label_of_one_source_goes_before_that_of_any_source(order: int) -> None:
    labels = [GOOD, {"label": "164", "sdi": 2, "reading": "height_of_the_other", "range": 8192.0, "bits": 16}]
    decoder = arinc429.make_decoder(bind(arinc429.Options, {"set": "none", "labels": labels[::order]}, "test.toml"))
    words = [wire.encode_bnr("164", 100.0, 8192.0, 16, state=BnrState.NORMAL, sdi=sdi) for sdi in (1, 2, 1)]
    measurements = decoder.feed(b"".join(word.to_bytes(4, "big") for word in words), 1)
    assert [type(m) for m in measurements] == [RadioHeight, Reading, RadioHeight]


def test_steps_of_the_instrument_are_the_sigma_of_the_height() -> None:
    (entry,) = make_codecs(LabelSet(labels=built_in_sets()["freeflight_ra4500"].labels))
    for sent_ft, shown_ft, step_ft in ((57.3, 57.0, 1), (173.2, 174.0, 2), (1234.5, 1250.0, 50)):
        (word,) = entry.encode(RadioHeight(stamp=S, height_agl=sent_ft * FOOT))
        (found,) = entry.handlers()[0].decode(word, S)
        assert isinstance(found, RadioHeight)
        assert found.height_agl == pytest.approx(shown_ft * FOOT)
        assert found.sd == pytest.approx(step_ft * FOOT / math.sqrt(12))


def test_the_localizer_word_that_a_maker_prints_is_fly_right() -> None:
    """Genesys 64-000109 (GDR NAV/COMM installation manual), table 29: +0.021 DDM, bits 32 to 1 as printed there."""
    printed = int("1_11_0_000011011000_000000_00_11011110", 2)
    measurements = arinc429.make_decoder(arinc429.Options(set="ils")).feed(printed.to_bytes(4, "big") * 3, 1)
    assert measurements[0] == Deviation(stamp=Stamp(1), localizer_ddm=216 * 0.4 / 4096)
    assert arinc429.make_encoder(arinc429.Options(set="ils")).encode(measurements[0]) == [printed.to_bytes(4, "big")]


def test_distances_in_both_kinds_of_words_are_nautical_miles() -> None:
    """12.34 NM in BCD is 22853.68 m; 1579 steps of 512 / 2^16 NM are 12.3359375 NM.  Words: PyPI arinc429, encoder."""
    decoder = arinc429.make_decoder(arinc429.Options(set="dme"))
    measurements = decoder.feed(bytes.fromhex("0048d081 e062b041") * 2, 1)
    assert measurements[:2] == [
        DmeRange(stamp=Stamp(1), station="dme_1", slant_range=pytest.approx(22_853.68)),  # type: ignore[arg-type]
        DmeRange(stamp=Stamp(1), station="dme_1", slant_range=12.3359375 * 1852.0),
    ]


# --------------------------------------------------------------------------------------------------- what is refused

GOOD = {"label": "164", "quantity": "radio_height", "unit": "ft", "range": 8192.0, "bits": 16}
PANEL = {"label": "270", "kind": "discrete", "name": "panel", "flags": {"test": 11}}


@pytest.mark.parametrize(
    ("label", "sentence"),
    [
        (GOOD | {"label": "999"}, "pattern"),
        (GOOD | {"quantity": "colour"}, "no quantity 'colour'"),
        (GOOD | {"reading": "height"}, "exactly one of quantity and reading"),
        (GOOD | {"quantity": ""}, "exactly one of quantity and reading"),
        (GOOD | {"unit": "kt"}, "unit 'kt'; allowed here: m, ft"),
        (GOOD | {"bits": None}, "needs range and bits"),
        (GOOD | {"kind": "bcd"}, "needs resolution"),
        (GOOD | {"kind": "bcd", "resolution": 1.0, "fine_label": "120"}, "a BCD word has no fine_label"),
        (GOOD | {"bits": 21}, "less than or equal to 20"),
        (GOOD | {"bits": 19, "sdi": 1}, "a word of 19 bits has no sdi"),
        (GOOD | {"quantity": "altitude", "steps": "freeflight_ra4500"}, "steps needs the quantity radio_height"),
        (PANEL | {"flags": {}}, "needs a name, and flags or fields"),
        (PANEL | {"name": ""}, "needs a name, and flags or fields"),
        (PANEL | {"flags": {"test": 10}}, "greater than or equal to 11"),
        (PANEL | {"not_ok": ["tset"]}, "not_ok names tset; flags are test"),
        (PANEL | {"fields": {"mode": [15, 13]}}, "field mode: the lowest bit must be first"),
    ],
)
def test_a_wrong_label_is_refused_in_a_sentence(label: dict[str, object], sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        bind(arinc429.Options, {"labels": [label]}, "test.toml")


def test_a_wrong_label_is_named_by_its_place() -> None:
    with pytest.raises(ConfigError, match=r"^test.toml: options.labels.list\[1\].bits = 21: [^;]*$"):
        bind(arinc429.Options, {"labels": [GOOD, GOOD | {"bits": 21}]}, "test.toml", "options")


@pytest.mark.parametrize(
    ("text", "error", "sentence"),
    [
        ("labels = [", ValueError, "labels_file: is not valid TOML"),
        ("labels = 3", ValueError, r"labels_file: labels: must be a table with labels, \[labels\]"),
        ("[ours]", ConfigError, "labels_file: ours.labels: missing"),
        ("[ours]\nequipment = '7'\nlabels = []", ConfigError, "labels_file: ours.equipment = '7'"),
        (
            "[ours]\nlabels = [{ label = '164' }]",
            ConfigError,
            r"labels_file: ours.labels\[0\].*exactly one of quantity and reading",
        ),
    ],
)
def test_a_wrong_file_is_refused_in_a_sentence(text: str, error: type[Exception], sentence: str) -> None:
    with pytest.raises(error, match=sentence):
        read_sets(text, "labels_file")


def test_labels_must_be_there_and_differ() -> None:
    def decoder(**changes: object) -> None:
        arinc429.make_decoder(bind(arinc429.Options, changes, "test.toml"))

    with pytest.raises(ValueError, match="none enabled"):
        decoder(set="none")
    with pytest.raises(ValueError, match="164 occurs twice"):
        decoder(labels=[GOOD, GOOD])
    with pytest.raises(ValueError, match=r"set 'fms': unknown set; built in: radio_altimeter, .*none$"):
        decoder(set="fms")
    with pytest.raises(ValueError, match="none; in labels_file: our_gps"):
        decoder(set="gbs", labels=OUR_LABELS)
