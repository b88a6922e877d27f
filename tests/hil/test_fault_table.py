"""Profiles: a table is equivalent to a scenario; errors have file, line, column and the allowed values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter

from fti.errors import ConfigError, MissingError
from fti.example_files import SCENARIOS
from fti.hil.scenario import load, load_config
from fti.hil.scenario.fault_table import KINDS, parse
from fti.hil.tables.fault_types import Burst, Cut, Fault, Forced, Invalid
from fti.hil.tables.schema import Expectation
from tests.helpers import ROOT

HEADER = "time,channel,value,fault,expected,plus,minus,within\n"
MAKE: TypeAdapter[Fault] = TypeAdapter(Fault)
#: A fault of every kind that a table can have: its parameters.
SAMPLES: dict[str, dict[str, Any]] = {
    "attitude_offset": {"roll_deg": -2.0, "heading_deg": 10.0},
    "babbling": {"can_id": 17, "rate_hz": 500.0},
    "bias": {"quantity": "reading.value", "value": -3.5, "name": "mach"},
    "bit_errors": {"rate": 1e-4},
    "breaker": {},
    "brown_out": {"supply_v": 11.0},
    "burst": {"hold_s": 0.5},
    "bus_off": {},
    "can_status": {"flags": ["bus_error", "data_overrun"]},
    "clock_drift": {"ppm": -40.0},
    "clock_jump": {"by_s": -2.5},
    "cut": {},
    "duplicated": {"share": 0.5},
    "fog": {"visibility_m": 100.0, "echo_m": [75.0, 5.0]},
    "forced": {"quantity": "imu_sample.gyro_b_2", "value": 0.1},
    "freeze": {},
    "gnss_degraded": {"horizontal_m": 20.0, "vertical_m": 40.0},
    "gnss_offset": {"north_m": 100.0, "over_s": 5.0},
    "gnss_outage": {},
    "gnss_ramp": {"north_mps": 1.0, "onset_mps2": 0.1, "with_velocity": False},
    "inertial_bias": {"gyro_degph": [0.0, 0.0, 50.0], "accel_mg": [1.0, 0.0, -2.0]},
    "invalid": {"flags": ["unlocked", "failure"]},
    "latency": {"by_s": 1.5},
    "lever_arm": {"forward_m": 5.0, "down_m": -1.0},
    "lost_header": {"count": 2, "share": 0.25},
    "mounting": {"roll_deg": -2.0, "pitch_deg": 1.0, "yaw_deg": 1.5},
    "noise": {"quantity": "range.slant_range", "sd": 4.0},
    "ramp": {"quantity": "position.lat", "rate": 1e-6},
    "reordered": {},
    "scale": {"quantity": "range.slant_range", "percent": -10.0},
    "stuck": {},
    "swapped_coordinates": {},
    "truncated": {"count": 7},
    "undulation": {"stated": "msl_as_ellipsoid"},
    "wrong_checksum": {},
    "wrong_label": {"share": 0.1},
    "wrong_unit": {"quantity": "radio_height.height_agl", "factor": 0.3048},
}
ON = {"babbling": "links", "bus_off": "links", "can_status": "links"}


def as_toml(kind: str, names: list[str], from_s: float, to_s: float) -> str:
    """The fault as a scenario has it."""
    keys = {"kind": kind, ON.get(kind, "devices"): names, "from_s": from_s, "to_s": to_s, **SAMPLES[kind]}
    return "[[fault]]\n" + "".join(f"{key} = {_literal(value)}\n" for key, value in keys.items() if value != [])


def _literal(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_literal, value))}]"
    return json.dumps(value)


def _cell(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def as_rows(kind: str, names: list[str], from_s: float, to_s: float) -> list[tuple[float, str]]:
    """The two rows of the fault, each with its time."""
    parameters = dict(SAMPLES[kind])
    quantity = parameters.pop("quantity", "")
    channel = "+".join(names) or "*"
    channel += f".{quantity}" if quantity else ""
    value = ";".join(f"{k}={'|'.join(map(str, v)) if isinstance(v, list) else _cell(v)}" for k, v in parameters.items())
    return [(from_s, f"{from_s},{channel},{value},{kind}"), (to_s, f"{to_s},{channel},{kind},end")]


def as_table(faults: list[tuple[str, list[str], float, float]]) -> str:
    return HEADER + "\n".join(text for _, text in sorted(row for fault in faults for row in as_rows(*fault)))


FAULTS = [(kind, ["a", "b"][: n % 3], float(n), float(n + 5)) for n, kind in enumerate(sorted(KINDS))]


# ----------------------------------------------------------------------------------------------------- what it says


def test_every_kind_of_a_device_or_a_link_can_stand_in_a_table() -> None:
    assert set(SAMPLES) == set(KINDS)


def test_a_table_is_equivalent_to_a_scenario(tmp_path: Path) -> None:
    expect = (
        '[[expect]]\nchannel = "/nav/glide_slope.dots"\nat_s = 60\nvalue = 0.5\nplus = 0.2\nminus = 0.1\nwithin_s = 2\n'
    )
    head = 'title = "x"\ndescription = ""\nconfig = "none.toml"\n'
    (tmp_path / "one.toml").write_text(head + "".join(as_toml(*fault) for fault in FAULTS) + expect)
    (tmp_path / "two.toml").write_text(f'{head}profile = "rows.csv"\n')
    rows = as_table(FAULTS) + "\n60,/nav/glide_slope.dots,,,0.5,0.2,0.1,2\n"
    (tmp_path / "rows.csv").write_text(rows)
    one, two = load(tmp_path / "one.toml"), load(tmp_path / "two.toml")
    assert two.fault == one.fault
    assert len(two.fault) == len(KINDS)
    assert two.expect == one.expect
    assert two.flight_key == one.flight_key


def test_the_content_of_a_table_follows_that_of_the_scenario(tmp_path: Path) -> None:
    first = '[[fault]]\nkind = "cut"\nfrom_s = 1\nto_s = 2\n'
    (tmp_path / "s.toml").write_text(f'title="x"\ndescription=""\nconfig="c"\nprofile="p.csv"\n{first}')
    (tmp_path / "p.csv").write_text(HEADER + "0,*,,freeze\n9,*,,end\n")
    assert [fault.kind for fault in load(tmp_path / "s.toml").fault] == ["cut", "freeze"]


def test_set_points_follow_each_other() -> None:
    rows = "1,a.range.slant_range,10\n2,a.range.slant_range,20\n5,a.range.slant_range,,end\n"
    first, second = parse(HEADER + rows, "p.csv").faults
    assert first == Forced(
        kind="forced", devices=("a",), from_s=1.0, to_s=2.0, quantity="range.slant_range", value=10.0
    )
    assert second == first.model_copy(update={"from_s": 2.0, "to_s": 5.0, "value": 20.0})


def test_faults_on_one_channel_overlap_and_end_by_their_kind() -> None:
    rows = "1,a,,cut\n2,a,0.5,burst\n3,a,cut,end\n4,a,,end\n"
    assert parse(HEADER + rows, "p.csv").faults == (
        Cut(kind="cut", devices=("a",), from_s=1.0, to_s=3.0),
        Burst(kind="burst", devices=("a",), from_s=2.0, to_s=4.0, hold_s=0.5),
    )


def test_blanks_comments_quotes_the_order_of_columns_and_a_mark_of_a_spreadsheet_do_not_matter() -> None:
    text = '\ufeff# times in s\n\nfault , channel,time,value\n invalid, "a", 1 ,unlocked\n  # a note\r\nend,a,2,,,\n'
    assert parse(text, "p.csv").faults == (
        Invalid(kind="invalid", devices=("a",), from_s=1.0, to_s=2.0, flags=("unlocked",)),
    )


@pytest.mark.parametrize(
    ("message", "value"), [("true", True), ("false", False), ("-2.5", -2.5), ("3", 3.0), ("off_track", "off_track")]
)
def test_an_expectation_has_the_type_of_what_is_written(message: str, value: bool | float | str) -> None:
    (found,) = parse(f"{HEADER}4,/nav/x.y,,,{message}\n", "p.csv").expectations
    assert found == Expectation(channel="/nav/x.y", at_s=4.0, value=value, within_s=1.0)
    assert type(found.value) is type(value)


def test_the_shipped_table_fits_its_configuration() -> None:
    scenario = load(SCENARIOS / "table.toml")
    assert load_config(scenario).path == str(ROOT / "configs" / "demo.toml")
    assert [fault.kind for fault in scenario.fault] == [
        "cut",
        "forced",
        "forced",
        "wrong_checksum",
        "burst",
        "babbling",
    ]
    assert len(scenario.expect) == 4


# ---------------------------------------------------------------------------------------------------------- mistakes


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"p\.csv: is empty; its first line must name the columns: time, channel"),
        ("time,chanel\n", r"p\.csv: line 1: unknown column 'chanel'; allowed: time, channel, value"),
        ("time,time,channel\n", r"line 1: duplicate column 'time'"),
        ("channel,fault\n", r"line 1: missing column 'time'; required: time, channel"),
        ("time;channel\n", r"line 1: unknown column 'time;channel'"),
        (HEADER + "soon,a,,cut\n", r"p\.csv: line 2, time = 'soon': must be a number"),
        (HEADER + ",a,,cut\n", r"line 2, time = '': must be a number of seconds, not less than 0"),
        (HEADER + "nan,a,,cut\n", r"line 2, time = 'nan': must be a number of seconds"),
        (HEADER + "5,a,,cut\n\n4,a,,end\n", r"line 4, time = '4': must be a number of seconds, not less than 5"),
        (HEADER + "5,a,,explosion\n", r"line 2, fault = 'explosion': unknown kind of fault; allowed: stuck, invalid"),
        (HEADER + "5,a,,obstacle\n", r"line 2, fault = 'obstacle': unknown kind"),
        (HEADER + "5,a\n", r"line 2, fault = '': is empty, as are value and expected"),
        (HEADER + "5,,,cut\n", r"line 2, channel = '': cut needs a name, a\+b, or \*"),
        (HEADER + "5,a,3,bias\n", r"line 2, channel = 'a': bias needs DEVICE\.MEASUREMENT\.NUMBER"),
        (HEADER + "5,a,3\n", r"line 2, channel = 'a': forced needs DEVICE"),
        (HEADER + "5,a.range.slant_range,,cut\n", r"channel = 'a.range.slant_range': cut affects whole devices"),
        (HEADER + "5,a,,cut\n6,a,,cut\n", r"line 3, fault = 'cut': is already active on this channel"),
        (HEADER + "5,a,,cut\n", r"line 2, fault = 'cut': never ends; a later row must have fault = end"),
        (HEADER + "5,a,,end\n", r"line 2, channel = 'a': has no active fault that could end"),
        (HEADER + "5,a,,cut\n6,a,burst,end\n", r"line 3, value = 'burst': is not active on this channel; active: cut"),
        (HEADER + "5,a,,cut\n5,a,,freeze\n6,a,,end\n", r"line 4, value = '': must be the kind that ends; active: cut"),
        (HEADER + "5,a,,cut\n5,a,,end\n", r"line 3, time = '5': must be after 5, the start of cut"),
        (HEADER + "5,a,-1,burst\n6,a,,end\n", r"line 2, value\.hold_s = -1: input should be greater than 0"),
        (HEADER + "5,a,long,burst\n6,a,,end\n", r"line 2, value\.hold_s = 'long': input should be a valid number"),
        (HEADER + "5,a,,burst\n6,a,,end\n", r"line 2, value\.hold_s: missing"),
        (HEADER + "5,a,hold=3,burst\n", r"line 2, value = 'hold=3': unknown parameter 'hold' of burst; allowed"),
        (HEADER + "5,a,3,cut\n", r"line 2, value = '3': cut has no default parameter; it has: none"),
        (HEADER + "5,a.rang.x,3\n6,a.rang.x,,end\n", r"line 2, value\.quantity.*unknown measurement 'rang'"),
        (HEADER + "5,a.range.x,3\n6,a.range.x,,end\n", r"unknown number 'x' of range; allowed: slant_range, sd"),
        (HEADER + "5,A,,cut\n6,A,,end\n", r"line 2, value\.devices\[0\] = 'A'"),
        (HEADER + "5,a,,cut,,1\n", r"line 2, plus = '1': must be empty in a row without expected"),
        (HEADER + "5,/nav/x.y,3,,4\n", r"line 2, value = '3': must be empty in a row with expected"),
        (HEADER + "5,nav,,,4\n", r"line 2, expected\.channel = 'nav'"),
        (HEADER + "5,/nav/x.y,,,4,much\n", r"line 2, plus = 'much': must be a number"),
        (HEADER + "5,/nav/x.y,,,4,,-1\n", r"line 2, expected\.minus = -1"),
        (HEADER + "5,a,,cut,,,,,extra\n", r"line 2: 'extra' is beyond the last column; the header has 8"),
        (HEADER + '5,"a,,cut\n', r"line 2: is not valid CSV"),
    ],
)  # fmt: skip
def test_errors_name_file_line_and_column(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parse(text, "p.csv")


def test_a_table_that_is_not_there_is_missing(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('title="x"\ndescription=""\nconfig="c"\nprofile="p.csv"\n')
    with pytest.raises(MissingError, match=r"p\.csv: cannot be read"):
        load(tmp_path / "s.toml")
