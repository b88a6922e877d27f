"""The configuration: strict, frozen, with clear errors."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pydantic
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti import config, drivers
from fti.config import loading
from fti.devices import bind_devices
from fti.errors import ConfigError, MissingError
from fti.nav import navigation
from fti.nav.alarm_conditions import FALLBACKS
from tests.helpers import ROOT

EXAMPLES = sorted((ROOT / "configs").glob("*.toml"))
FILE = Path("somewhere/test.toml")

GOOD = """
[session]
name = "da42"

[[link]]
name = "line"
kind = "serial"
port = "/dev/ttyUSB0"
baud = 57600

[[link]]
name = "net"
kind = "udp"
bind = "127.0.0.1:4000"

[[link]]
name = "bus"
kind = "can"
interface = "slcan"
channel = "/dev/ttyACM0"

[[device]]
name = "radar"
link = "line"
driver = "freeflight_ra4500"
lever_arm_b = [0.4, 0, 0.3]
altimeter = { kind = "radar", range_m = [0, 800] }

[[device]]
name = "ins"
link = "net"
driver = "imar_ixcom"

[nav]
attitude = ["ins"]
altimeters = ["radar"]
terrain = { files = ["dem/a.npz"], vertical = "egm96" }
approach = { profile = "profiles/27.csv" }
"""


def parse(text: str) -> config.Config:
    return config.parse(tomllib.loads(text), text, FILE)


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def message(text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        parse(text)
    return str(caught.value)


# ------------------------------------------------------------------------------------------------------- examples


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.name)
def test_every_example_loads_and_binds(path: Path) -> None:
    loaded = config.load(path)
    assert len(bind_devices(loaded)) == len(loaded.device)
    assert loaded.text == path.read_text()


def test_there_are_the_examples_that_the_readme_promises() -> None:
    assert {"research_aircraft.toml", "uav_mavlink.toml", "bench.toml"} <= {p.name for p in EXAMPLES}


def test_every_driver_is_in_an_example() -> None:
    assert {d.driver for path in EXAMPLES for d in config.load(path).device} == set(drivers.names())


def test_the_research_aircraft_has_the_sensors_of_table_6_1() -> None:
    """Spiegel 2018, tables 6.1 and 6.2: label, interface, rate; five pickup computers on two buses."""
    aircraft = config.load(ROOT / "configs" / "research_aircraft.toml")
    kinds = {link.name: link.kind for link in aircraft.link}
    rates = {d.name: d.rate_hz for d in aircraft.device}
    assert kinds == {
        "ins_serial": "serial",
        "ins_ethernet": "udp",
        "gnss": "serial",
        "sensor_bus_1": "can",
        "sensor_bus_2": "can",
        "laser": "serial",
        "radar": "serial",
        "magnetometer": "serial",
    }
    assert rates == {
        "ins": 100,
        "ins_fast": 300,
        "gnss_receiver": 10,
        "air_data": 10,
        "laser_altimeter": 9,
        "radar_altimeter": 25,
        "magnetic_field": 20,
        "pickups_1": 10,
        "pickups_2": 10,
    }
    assert {link.name for link in aircraft.link if link.transmit} == {"gnss", "magnetometer"}  # silent until asked


# --------------------------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (changed('name = "da42"', 'name = "DA 42"'), ["session.name", "'DA 42'", "lower-case letters"]),
        (changed("baud = 57600", "boud = 57600"), ["link[0].boud", "no such key", "baud"]),
        (changed("baud = 57600", 'baud = "57600"'), ["link[0].baud", "'57600'", "integer"]),
        (changed("baud = 57600", "baud = 0"), ["link[0].baud", "0", "greater than 0"]),
        (
            changed('kind = "serial"', 'kind = "usb"'),
            ["link[0]", "'usb'", "unknown kind 'usb'; allowed: serial, udp, can"],
        ),
        (changed('kind = "serial"', ""), ["link[0]", "kind"]),
        (changed('bind = "127.0.0.1:4000"', 'bind = "4000"'), ["link[1].bind", "'4000'"]),
        (changed('port = "/dev/ttyUSB0"\n', ""), ["link[0].port", "missing"]),
        (changed('link = "line"', 'link = "lien"'), ["device[0].link", "'lien'", "line, net, bus"]),
        (changed('name = "net"', 'name = "line"'), ["link[1].name", "'line'", "twice"]),
        (changed('name = "ins"', 'name = "radar"'), ["device[1].name", "'radar'", "twice"]),
        (changed('attitude = ["ins"]', 'attitude = ["imu"]'), ["nav.attitude", "'imu'", "radar, ins"]),
        (
            GOOD.replace('"ins"', '"vertical"'),
            ["nav.attitude", "'vertical'", "the names filter, radio, vertical"],
        ),
        (changed("lever_arm_b = [0.4, 0, 0.3]", "lever_arm_b = [0.4, 0]"), ["device[0].lever_arm_b"]),
        (changed("lever_arm_b = [0.4, 0, 0.3]", "lever_arm_b = [0.4, nan, 0]"), ["device[0].lever_arm_b", "nan"]),
        (changed("[0, 800]", "[800, 0]"), ["device[0].altimeter.range_m", "800", "below"]),
        (changed("altimeter = {", "rpy_bs_deg = [180, 0, 0]\naltimeter = {"), ["[0].rpy_bs_deg", "180", "point down"]),
        (changed("altimeter = {", "rpy_bs_deg = [0, 90, 0]\naltimeter = {"), ["[0].rpy_bs_deg", "90", "85 degrees"]),
        (
            changed('kind = "radar", ', 'kind = "sonar", '),
            ["altimeter.kind", "'sonar'", "'radar', 'laser' or 'multibeam'"],
        ),
        (changed('altimeters = ["radar"]', 'altimeters = ["ins"]'), ["nav.altimeters", "'ins'", "altimeter"]),
        (changed('vertical = "egm96"', 'vertical = "navd88"'), ["nav.terrain.vertical", "'navd88'", "'egm2008'"]),
        (changed('vertical = "egm96"', 'vertical = "egm96", datum = 1'), ["nav.terrain.datum", "sd_m, vertical"]),
        (changed('files = ["dem/a.npz"], vertical = "egm96"', ""), ["nav.terrain", "exactly one of files and scene"]),
        (changed(', vertical = "egm96"', ""), ["nav.terrain.vertical", "missing", "egm2008"]),
        (changed('vertical = "egm96"', 'vertical = "egm96", radius_m = 9'), ["nav.terrain", "centre_deg", "both"]),
        (changed('files = ["dem/a.npz"]', 'scene = "demo"'), ["nav.terrain.vertical", "not allowed with scene"]),
        (
            changed('vertical = "egm96"', 'vertical = "egm96", land_cover = "c.tif"'),
            ["nav.terrain.cover: missing", "need each other"],
        ),
        (
            changed(
                'vertical = "egm96"',
                'vertical = "egm96", land_cover = "c.tif", cover = [{ classes = [10, 20], altimeter = "laser", '
                'sd_m = 1 }, { classes = [20], altimeter = "laser", excluded = true }]',
            ),
            ["nav.terrain.cover", "class 20 of a laser is named twice"],
        ),
        (
            changed(
                'vertical = "egm96"',
                'vertical = "egm96", land_cover = "c.tif", cover = [{ classes = [10], altimeter = "laser" }]',
            ),
            ["nav.terrain.cover[0]: needs bias_m, sd_m or excluded"],
        ),
        (
            changed(
                'vertical = "egm96"',
                'vertical = "egm96", land_cover = "c.tif", cover = [{ classes = [10], altimeter = "laser", '
                "sd_m = 1, excluded = true }]",
            ),
            ["nav.terrain.cover[0].excluded: not allowed with sd_m"],
        ),
        (GOOD + '[nav.filter]\nimu = "imu"', ["nav.filter.imu", "'imu'", "radar, ins"]),
        (GOOD + '[nav.filter]\nimu = "ins"\naltimeters = ["ins"]', ["nav.filter.altimeters", "'ins'", "radar"]),
        (
            changed("altimeter = {", "rpy_bs_deg = [0, 5, 0]\naltimeter = {") + '[nav.filter]\nimu = "radar"',
            ["device[0].rpy_bs_deg", "[0.0, 5.0, 0.0]", "inertial unit", "separate [[device]] for the altimeter"],
        ),
        (GOOD + '[nav.radio]\nreceiver = "gps"', ["nav.radio.receiver", "'gps'", "radar, ins"]),
        (GOOD + '[nav.radio]\naltimeter = "ins"', ["nav.radio.altimeter", "'ins'", "radar"]),
        (
            changed("[nav]", "[navigation]"),
            ["navigation", "no such key", "bus, device, display, link, nav, publish, recorder, session, snapshot"],
        ),
        (changed('name = "da42"', 'name = "da42"\nmode = "snapshot"'), ["session.mode = 'snapshot'", "[snapshot]"]),
        (GOOD + "[snapshot]\nbefore_s = 0", ["snapshot.before_s", "0", "greater than 0"]),
        (GOOD + "[recorder]\npriority = 50", ["recorder.priority", "50", "less than or equal to 49"]),
        ("path = '/etc'\n" + GOOD, ["path", "no such key"]),
        (changed('[session]\nname = "da42"', ""), ["session", "missing"]),
        (GOOD + '[display]\naddress = "0.0.0.0"', ["display.address", "'0.0.0.0'", "127.0.0.1"]),
    ],
)
def test_error_names_file_key_value_and_what_is_allowed(text: str, expected: list[str]) -> None:
    text = message(text)
    assert text.startswith(str(FILE))
    for part in expected:
        assert part in text
    assert "\n" not in text


def test_a_wrong_entry_of_a_list_is_one_mistake() -> None:
    table = '{ classes = [300], altimeter = "laser", sd_m = 1 }'
    text = message(changed('vertical = "egm96"', f'vertical = "egm96", land_cover = "c.tif", cover = [{table}]'))
    assert "nav.terrain.cover[0].classes[0] = 300" in text and "at least" not in text


def test_reserved_device_names_are_those_of_the_fallbacks() -> None:
    assert (
        set(loading.RESERVED_DEVICE_NAMES)
        == {navigation.FILTER, navigation.RADIO, navigation.VERTICAL}
        == set(FALLBACKS)
    )


def test_one_error_names_every_mistake() -> None:
    text = message(changed("baud = 57600", "boud = 1").replace('bind = "127.0.0.1:4000"', 'bind = "x"'))
    assert "link[0].boud" in text
    assert "link[1].bind" in text


def test_a_file_that_is_missing_not_text_or_not_toml_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match=r"none\.toml: cannot be read: No such file"):
        config.load(tmp_path / "none.toml")
    with pytest.raises(MissingError, match="Is a directory"):
        config.load(tmp_path)
    file = tmp_path / "bad.toml"
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="UTF-8"):
        config.load(file)
    file.write_text("[session\n")
    with pytest.raises(ConfigError, match=r"bad\.toml: is not valid TOML: .*line 1"):
        config.load(file)


@pytest.mark.parametrize("text", ["a = " + "9" * 5000, "a = " + "[" * 5000])
def test_toml_that_python_refuses_is_a_wrong_configuration(tmp_path: Path, text: str) -> None:
    (tmp_path / "bad.toml").write_text(text)
    with pytest.raises(ConfigError, match=r"bad\.toml: is not valid TOML"):
        config.load(tmp_path / "bad.toml")


# ------------------------------------------------------------------------------------------------------- binding


def test_binding_names_unknown_drivers_carriers_and_options() -> None:
    radar = 'driver = "freeflight_ra4500"'
    with pytest.raises(ConfigError, match=r"device\[0\]\.driver = 'ra4500': .*freeflight_ra4500"):
        bind_without_files(changed(radar, 'driver = "ra4500"'))
    with pytest.raises(ConfigError, match=r"device\[0\]\.link = 'bus': is a can link; .* supports serial, udp"):
        bind_without_files(changed('link = "line"', 'link = "bus"'))
    with pytest.raises(ConfigError, match=r"device\[0\]\.options\.checksum = 'crc': .*'none', 'xor' or 'sum'"):
        bind_without_files(changed(radar, radar + '\noptions = { checksum = "crc" }'))
    with pytest.raises(ConfigError, match=r"device\[0\]\.options\.check: there is no such key; .*checksum"):
        bind_without_files(changed(radar, radar + '\noptions = { check = "xor" }'))


def bind_without_files(text: str) -> None:
    bind_devices(parse(text), texts={})


# ---------------------------------------------------------------------------------------------------- paths, frozen


def test_relative_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    file = tmp_path / "sub" / "a.toml"
    file.parent.mkdir()
    file.write_text(GOOD)
    loaded = config.load(file)
    assert loaded.nav.terrain is not None
    assert loaded.nav.approach is not None
    assert loaded.nav.terrain.files == (str(file.parent / "dem/a.npz"),)
    assert loaded.nav.approach.profile == str(file.parent / "profiles/27.csv")
    assert loaded.session.directory == str(file.parent / "data")


def test_frozen() -> None:
    loaded = parse(GOOD)
    with pytest.raises(pydantic.ValidationError):
        loaded.session.name = "other"


def test_links_moved_to_a_folder() -> None:
    """Serial and slcan ports go where an emulator puts them; the rest stays."""
    line, net, bus = config.with_links(parse(GOOD), "/run/links").link
    assert isinstance(line, config.SerialLink)
    assert isinstance(bus, config.CanLink)
    assert (line.port, bus.channel) == ("/run/links/line", "/run/links/bus")
    assert net == parse(GOOD).link[1]
    real_bus = parse(
        changed('interface = "slcan"\nchannel = "/dev/ttyACM0"', 'interface = "socketcan"\nchannel = "can0"')
    )
    assert config.with_links(real_bus, "/run/links").link[2] == real_bus.link[2]


def test_session_replaced_and_devices_found() -> None:
    loaded = config.with_session(parse(GOOD), origin="hil", directory="/data")
    assert (loaded.session.origin, loaded.session.directory, loaded.session.name) == ("hil", "/data", "da42")
    assert [d.name for d in loaded.devices_on("net")] == ["ins"]
    assert loaded.find_device("radar") == loaded.device[0]
    assert loaded.find_device("nobody") is None


# ------------------------------------------------------------------------------------------------- random tables

TABLE_NAMES = {"session", "link", "device", "nav", "display", "x", "path", "text"}
KEYS = st.sampled_from(sorted({*re.findall(r"(\w+) =", GOOD), *TABLE_NAMES}))
LEAVES = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["serial", "udp", "can", "line", "radar", "egm96"])
    | st.dates()
)
TABLES = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=4), max_leaves=10
)


@given(table=st.dictionaries(KEYS, TABLES, max_size=5))
def test_any_table_loads_or_is_refused_by_name(table: dict[str, Any]) -> None:
    try:
        config.parse(table, "", FILE)
    except ConfigError as error:
        check_names_file_and_key(error, table)


@st.composite
def damaged(draw: st.DrawFn) -> dict[str, Any]:
    """The good table with one value replaced, somewhere."""
    table = copy.deepcopy(tomllib.loads(GOOD))
    node: Any = table
    while True:
        key = draw(st.sampled_from(sorted(node) if isinstance(node, dict) else range(len(node))))
        if not (isinstance(node[key], dict | list) and node[key]) or draw(st.booleans()):
            node[key] = draw(TABLES)
            return table
        node = node[key]


@given(table=damaged())
def test_one_wrong_value_is_refused_by_name(table: dict[str, Any]) -> None:
    try:
        config.parse(table, "", FILE)
    except ConfigError as error:
        check_names_file_and_key(error, table)


def check_names_file_and_key(error: ConfigError, table: dict[str, Any]) -> None:
    """Each sentence begins with the file; its key path begins with a key of the table or one that is missing."""
    first = str(error).split("; ")[0]
    file, key = first.split(": ")[:2]
    assert file == str(FILE)
    assert key.split(" = ")[0].split(".")[0].split("[")[0] in {*table, *config.Config.model_fields}


@pytest.mark.parametrize(
    ("table", "enabled"),
    [
        ("", False),
        ("[bus]\n", False),
        ("[bus]\nport = 7447\n", True),
        ("[bus]\nenabled = true\n", True),
        ("[bus]\nenabled = false\nport = 7447\n", False),
    ],
)
def test_foreign_clients_are_served_where_the_configuration_says_so_or_names_their_port(
    table: str, enabled: bool
) -> None:
    found = parse(f"{GOOD}\n{table}").bus
    assert found.enabled == enabled
    assert type(found).model_validate_json(found.model_dump_json()) == found


# --------------------------------------------------------------------------------------------------------- bounds


def _unbounded(node: Any, where: str) -> Iterator[str]:
    """Places of a JSON schema where a number may be of any size."""
    if isinstance(node, dict):
        if node.get("type") in ("number", "integer") and not ({"maximum", "enum", "const"} & set(node)):
            yield where
        for key, child in node.items():
            yield from _unbounded(child, f"{where}.{key}")
    elif isinstance(node, list):
        for child in node:
            yield from _unbounded(child, where)


def test_no_number_may_be_of_any_size() -> None:
    """What is multiplied by 1e9 to nanoseconds, or allocated, must stay finite."""
    schema = config.Config.model_json_schema()
    assert list(_unbounded(schema, "")) == []


@pytest.mark.parametrize("value", ["1e308", "86401.0", "0.0", "-1.0", "nan", "inf", "1" + "0" * 300])
def test_a_split_of_any_length_is_a_wrong_configuration(value: str) -> None:
    text = message(changed("[session]", f"[session]\nsplit_s = {value}"))
    assert text.startswith(f"{FILE}: session.split_s = ")


def test_elevation_files_in_a_zip_are_relative_to_the_file_and_gdal_paths_stay() -> None:
    paths = {
        "/vsizip/tiles.zip/a.hgt": f"/vsizip/{FILE.parent.absolute()}/tiles.zip/a.hgt",
        "/vsizip//data/tiles.zip/a.hgt": "/vsizip//data/tiles.zip/a.hgt",
        "/vsicurl/https://a.example/b.tif": "/vsicurl/https://a.example/b.tif",
    }
    loaded = parse(changed('"dem/a.npz"', ", ".join(f'"{path}"' for path in paths)))
    assert loaded.nav.terrain is not None
    assert loaded.nav.terrain.files == tuple(paths.values())
