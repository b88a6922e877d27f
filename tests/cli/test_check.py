"""``fti check``: what a configuration means, and one sentence for what is wrong with it."""

from __future__ import annotations

import json
import math
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from affine import Affine

from fti import config
from fti.cli import _check_sinks, _receive_buffer
from fti.cli._limit_warnings import limit_warnings
from fti.cli.check import worst_load
from fti.cli.main import main
from fti.links.sockets import RECEIVE_BUFFER
from tests.helpers import ROOT
from tests.terrain.elevation_files import LAT, LON, Array, write_ground, write_tif

REFERENCE = ROOT / "configs" / "profiles" / "demo.csv"

BENCH = """
[session]
name = "bench"

[[link]]
name = "line"
kind = "serial"
port = "/dev/ttyUSB0"
baud = 57600

[[link]]
name = "spare"
kind = "serial"
port = "/dev/ttyUSB0"

[[device]]
name = "radar"
link = "line"
driver = "freeflight_ra4500"
rate_hz = 25
altimeter = { kind = "radar", range_m = [0, 800] }

[nav]
altimeters = ["radar"]
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_text(BENCH)
    return path


def publish_config(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "publish.toml"
    path.write_text(f'{BENCH}\n[publish]\naircraft = "D-EFTI"\n{text}')
    return path


SINKS = """
[publish.mqtt]
host = "ground.example.org"
tls = true
user = "aircraft"
topics = ["/nav/*", "/event"]
[publish.zenoh]
connect = "tcp/127.0.0.1:7447"
[publish.foxglove]
[publish.nmea]
tcp_port = 10110
udp = ["192.168.10.20:10110", "192.168.10.21:10110"]
[publish.gdl90]
udp = ["192.168.10.30:4000"]
[publish.mavlink]
udp = ["192.168.10.40:14550"]
"""


def test_each_sink_has_a_line_with_address_content_rate_and_protection(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(publish_config(tmp_path, SINKS))]) == 0
    out = capsys.readouterr().out
    lines = {line.split()[0]: " ".join(line.split()) for line in out.partition("\nsinks\n")[2].splitlines()}
    assert lines["mqtt"] == (
        "mqtt MQTT broker ground.example.org:8883 topics /nav/*, /event at most 5 Hz TLS, user aircraft"
    )
    assert lines["zenoh"].endswith("zenoh router tcp/127.0.0.1:7447 all topics at most 10 Hz not encrypted, no login")
    assert lines["foxglove"] == "foxglove listens on 127.0.0.1:8765 all topics at most 25 Hz on this computer only"
    assert "127.0.0.1:10110, UDP 192.168.10.20:10110, UDP 192.168.10.21:10110 sentences GGA," in lines["nmea"]
    assert lines["gdl90"].endswith("not encrypted") and "as system 100" in lines["mavlink"]


def test_every_sink_that_there_is_is_described() -> None:
    tables = {name for name, field in config.Publish.model_fields.items() if "Table" in str(field.annotation)}
    assert set(_check_sinks.DESCRIBE) == tables


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "publish: sends nothing: it has no sink"),
        ("[publish.foxglove]\nport = 8080", "publish.foxglove.port = 8080: is also display.port"),
        ("[publish.foxglove]\nport = 9\n[publish.nmea]\ntcp_port = 9", "port = 9: is also publish.nmea.tcp_port"),
        ('[publish.mqtt]\nuser = "a"\npassword_file = "none"', "publish.mqtt.password_file = "),
        ("[publish.mqtt]\ntls = true\nca_file = 'bench.toml'", "publish.mqtt: ca_file, certificate, private_key"),
        ('[publish.mqtt]\nuser = "a"\npassword_file = "a\\u0000b"', "publish.mqtt.password_file = "),
        ('[publish.mqtt]\ntls = true\nca_file = "a\\u0000b"', "embedded null byte"),
    ],
)
def test_a_sink_that_cannot_work_is_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, words: str
) -> None:
    assert main(["check", str(publish_config(tmp_path, text))]) == 0
    assert words in "".join(line for line in capsys.readouterr().out.splitlines() if line.startswith("warning: "))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[publish.mqtt]\nca_file = 'ca.pem'", "ca_file and certificate need tls = true"),
        ("[publish.foxglove]\nhost = '0.0.0.0'", "publish.foxglove.host: there is no such key"),
        ("[publish.zenoh]\nconnect = 'ground:7447'", "must be tcp/HOST:PORT or tls/HOST:PORT, such as"),
        ("[publish.nmea]", "{}: tcp_port or udp is required"),
        ("[publish.gdl90]\nudp = ['224.0.0.1:4000']", "= '224.0.0.1:4000': must be the address of one receiver"),
        ("[publish.zenoh]\nconnect = 'tcp/127.0.0.1:65536'", "connect: port 65536; allowed is 1 to 65535"),
    ],
)
def test_a_wrong_value_or_combination_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, words: str
) -> None:
    assert main(["check", str(publish_config(tmp_path, text))]) == 2
    error = capsys.readouterr().err
    assert words in error and "value error" not in error


def test_an_encrypted_private_key_is_a_warning_and_no_question(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """OpenSSL would ask for the passphrase at the terminal, and wait."""
    key, certificate = tmp_path / "a.key", tmp_path / "a.pem"
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-subj", "/CN=a"]
    command += ["-keyout", str(key), "-out", str(certificate), "-passout", "pass:secret"]
    subprocess.run(command, check=True, capture_output=True)
    text = f"[publish.mqtt]\ntls = true\ncertificate = '{certificate}'\nprivate_key = '{key}'"
    assert main(["check", str(publish_config(tmp_path, text))]) == 0
    assert "the private key is encrypted; it must have no passphrase" in capsys.readouterr().out


def test_lists_have_one_thing_per_line_name_first(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(file)]) == 0
    printed = capsys.readouterr().out.splitlines()
    first_words = [line.split()[0] for line in printed]
    assert first_words == [
        f"{file}:", "session", "storage", "main", "links", "line", "spare", "devices", "radar",
        "roles", "attitude", "position", "altimeters", "approach", "warning:",
    ]  # fmt: skip
    assert "MB free" in printed[3]
    assert "radar" in printed[5]
    assert "recorded, not decoded" in printed[6]
    assert "no_attitude" in printed[10]
    assert printed[-1].endswith("links line and spare use the same port /dev/ttyUSB0")


def test_json_is_json_only(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(file), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert [link["name"] for link in content["links"]] == ["line", "spare"]
    assert content["roles"] == {"attitude": [], "position": [], "altimeters": ["radar"]}
    assert {m["role"]: m["reason"] for m in content["missing"]} == {
        "attitude": "no_attitude",
        "position": "no_position",
        "approach": "no_profile",
    }


@pytest.mark.parametrize(("beam_deg", "reason"), [(40, None), (25, "assumption")])
def test_a_reference_of_another_altimeter_is_reported(
    file: Path, capsys: pytest.CaptureFixture[str], beam_deg: float, reason: str | None
) -> None:
    altimeter = BENCH.replace("[0, 800]", f"[0, 800], beam_deg = {beam_deg}")
    file.write_text(altimeter.replace("[nav]", f'[nav]\napproach = {{ profile = "{REFERENCE}", alert_v_m = 50.0 }}'))
    assert main(["check", str(file), "--json"]) == 0
    missing = {m["role"]: m["reason"] for m in json.loads(capsys.readouterr().out)["missing"]}
    assert missing.get("approach") == reason
    assert main(["check", str(file)]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if line.split()[0] == "approach")
    assert str(REFERENCE) in line
    assert ("outputs that need it stay invalid (assumption)" in line) is (reason is not None)


def test_a_filter_on_a_device_without_inertial_data_is_refused(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file.write_text(BENCH + '\n[nav.filter]\nimu = "radar"\n')
    assert main(["check", str(file)]) == 2
    output = capsys.readouterr().err
    assert f"{file}: nav.filter.imu = 'radar': freeflight_ra4500 provides no inertial data" in output
    line = file.read_text().splitlines().index('imu = "radar"') + 1
    assert output.rstrip().endswith(f"imar_ixcom, mavlink (line {line})")
    file.write_text(file.read_text().replace("freeflight_ra4500", "imar_ixcom"))
    assert main(["check", str(file)]) == 0


def test_stall_is_that_of_a_full_line(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """57600 baud 8N1 are 5760 B/s; 25 messages a second in two reads cost 400 B/s more; two buffers, one to 90 %."""
    main(["check", str(file), "--json"])
    stall = json.loads(capsys.readouterr().out)["links"][0]["stall_s"]
    assert stall == pytest.approx(1.9 * 2**19 / (5760 + 25 * 2 * 8), abs=0.1)


def test_a_larger_buffer_survives_longer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stalls = []
    for size in (2**19, 2**20):
        file = tmp_path / f"{size}.toml"
        file.write_text(BENCH.replace("baud = 57600", f"baud = 57600\nbuffer_bytes = {size}"))
        main(["check", str(file), "--json"])
        stalls.append(json.loads(capsys.readouterr().out)["links"][0]["stall_s"])
    assert stalls[1] == pytest.approx(2 * stalls[0], abs=0.2)


@pytest.mark.parametrize(
    ("link", "rate_hz", "message_bytes"),
    [
        (config.CanLink(name="a", kind="can", interface="slcan", channel="x", bitrate=500_000), 500_000 / 111, 16),
        (config.CanLink(name="a", kind="can", interface="slcan", channel="x", fd=True), 1_000_000 / 111, 72),
        (config.UdpLink(name="a", kind="udp", bind="127.0.0.1:1"), 100, 1472),
        (config.SerialLink(name="a", kind="serial", port="x", baud=12000, parity="even", stop_bits=2), 100, 10),
    ],
    ids=["can", "can_fd", "udp", "serial_8e2"],
)
def test_the_worst_load_of_a_link(link: config.Link, rate_hz: float, message_bytes: float) -> None:
    load = worst_load(link, ())
    assert load.rate_hz == pytest.approx(rate_hz)
    assert load.message_bytes == pytest.approx(message_bytes)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("baud = 57600", "bauds = 57600", "link[0].bauds: there is no such key; allowed here: answer_ms, baud, "),
        ('driver = "freeflight_ra4500"', 'driver = "ra4500"', "device[0].driver = 'ra4500': no driver"),
        ("rate_hz = 25", "options = { checksum = 1 }", "device[0].options.checksum = 1: input should be 'none', "),
        ("[nav]", '[nav]\nterrain = { files = ["no.npz"], vertical = "egm96" }', "nav.terrain.files[0] = "),
        ("[nav]", '[nav]\napproach = { profile = "no.csv" }', "no.csv: cannot be read: No such file"),
        ("[nav]", '[[link]]\nname = "net"\nkind = "udp"\nbind = "127.0.0.1:99999"\n[nav]', "port 99999; allowed is"),
        ('kind = "serial"', 'kind = "udp"\nbind = "127.0.0.1:1"', "link[0].port: there is no such key"),
        (
            "[nav]",
            f'[nav]\napproach = {{ profile = "{REFERENCE}", window_m = 300.0 }}',
            "nav.approach.window_m = 300.0: ",
        ),
        ("[nav]", f'[nav]\napproach = {{ profile = "{REFERENCE}", alert_s_m = 300.0 }}', "must be 5.0 to 200.0"),
        (
            "[nav]",
            f'[nav]\napproach = {{ profile = "{REFERENCE}" }}',
            "alert_v_m: 5 m is below the minimum protection level ",
        ),
        (
            "[nav]",
            "[nav]\nalert_limits = { compared = true }",
            "nav.alert_limits.compared = true: no position would ever be valid: ",
        ),
    ],
)
def test_a_mistake_is_one_sentence_on_standard_error(
    file: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, expected: str
) -> None:
    file.write_text(BENCH.replace(old, new, 1))
    assert main(["check", str(file)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    lines = printed.err.splitlines()
    assert all(line.startswith(f"fti: {file}: ") for line in lines)
    assert len(lines) == (2 if expected.startswith("link[0].port") else 1)  # udp has no baud either
    assert expected in printed.err


def test_elevation_files_are_opened(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def with_terrain(vertical: str) -> None:
        terrain = f'[nav]\nterrain = {{ files = ["wgs.tif", "dem.tif"], vertical = "{vertical}" }}'
        file.write_text(BENCH.replace("[nav]", terrain, 1))

    write_ground(file.parent / "dem.tif", lambda lat, lon: 500.0 + 0.0 * lat * lon, "EPSG:32632", 20, 10.0)
    write_ground(file.parent / "wgs.tif", lambda lat, lon: 500.0 + 0.0 * lat * lon, "EPSG:4979", 20, 1e-3)
    with_terrain("ellipsoid")
    assert main(["check", str(file)]) == 0
    output = capsys.readouterr().out
    assert re.search(
        r"dem\.tif +GTiff +20 x 20 posts +10(\.\d+)? x 10(\.\d+)? m apart +ellipsoid \(from the caller\)", output
    )
    assert "ellipsoid (from its coordinate system)" in output
    with_terrain("egm96")
    assert main(["check", str(file)]) == 2
    output = capsys.readouterr().err
    assert "nav.terrain.files[0] = " in output
    assert "its coordinate system states ellipsoid, but vertical is 'egm96'" in output
    (file.parent / "wgs.tif").write_text("no elevation")
    assert main(["check", str(file)]) == 2
    assert "wgs.tif: is not an elevation file that GDAL can read" in capsys.readouterr().err


def test_elevation_that_is_larger_than_memory_is_shown_as_squares(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder of one file of 20 x 20 km with posts of 50 m; half of 16 MiB are 350 000 posts, more than the file has.

    With posts of 1 m the smallest square, 2.2 km, has 4.9 million posts: 224 MiB.  A centre would be another square.
    """
    folder = file.parent / "tiles"
    folder.mkdir()
    write_ground(folder / "dem.tif", lambda lat, lon: 500.0 + 0.0 * lat * lon, "EPSG:32632", 400, 50.0)

    def with_terrain(more: str) -> None:
        terrain = f'[nav]\nterrain = {{ files = ["tiles"], vertical = "ellipsoid", memory_mb = 16{more} }}'
        file.write_text(BENCH.replace("[nav]", terrain, 1))

    with_terrain("")
    assert main(["check", str(file)]) == 0
    output = capsys.readouterr().out
    assert "dem.tif  GTiff" in output and "in squares of 100.0 km, posts 50 m apart" in output
    with_terrain(", cell_m = 1")
    assert main(["check", str(file)]) == 2
    assert "memory_mb = 16: 1.1 km around 47.8" in (errors := capsys.readouterr().err) and "need 224 MiB" in errors
    with_terrain(", centre_deg = [47.9, 11.8], radius_m = 1000.0")
    assert main(["check", str(file)]) == 2
    assert "needs only one of memory_mb and centre_deg with radius_m" in capsys.readouterr().err


def test_the_sigma_of_the_terrain_is_shown_with_its_parts(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ridges from post to post, 4 m high: 4 sqrt(8 / 45) = 1.69 m RMS and 4 m at most by the change of posts.

    What the closed form needs: tests/terrain/files/test_resampling_error.py, with a wave of two posts.
    """

    def ridges(lat: Array, lon: Array) -> Array:
        row = np.arange(lat.shape[0])[:, None]
        return np.where(row % 2 == 0, 496.0, 504.0) + 0.0 * lon

    write_ground(file.parent / "dem.tif", ridges, "EPSG:32632", 100, 50.0)
    terrain = '[nav]\nterrain = { files = ["dem.tif"], vertical = "ellipsoid", sd_m = 2.0 }'
    file.write_text(BENCH.replace("[nav]", terrain, 1))
    assert main(["check", str(file)]) == 0
    output = capsys.readouterr().out
    match = re.search(
        r"posts 50 m apart +sigma (\S+) m: 2 m of the files and (\S+) m RMS of resampling, (\S+) m",
        output,
    )
    assert match, output
    sigma, rms, maximum = map(float, match.groups())
    assert rms == pytest.approx(4.0 * math.sqrt(8 / 45), rel=0.06)
    assert sigma == pytest.approx(math.hypot(2.0, rms), abs=0.01)
    assert 3.5 < maximum < 4.1
    assert main(["check", str(file), "--json"]) == 0
    (layer,) = json.loads(capsys.readouterr().out)["terrain_layers"]
    assert layer["sigma_m"] == pytest.approx(sigma, abs=0.01)


STATED = """
[nav.terrain]
files = ["dem.tif", "tiles"]
vertical = "ellipsoid"
sd_m = 2.0

[[nav.terrain.file]]
path = "tiles/new*"
date = 2019-05-01

[[nav.terrain.file]]
path = "tiles"
date = "2000-02"
sd_m = 4.0
"""


def test_datum_date_and_sigma_of_files_are_those_of_the_configuration(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file.parent / "tiles").mkdir()
    for name in ("dem.tif", "tiles/new.tif", "tiles/old.tif"):
        write_ground(file.parent / name, lambda lat, lon: 500.0 + 0.0 * lat * lon, "EPSG:32632", 20, 10.0)
    file.write_text(BENCH + STATED)
    assert main(["check", str(file), "--json"]) == 0
    described = json.loads(capsys.readouterr().out)
    properties = [tuple(each[key] for key in ("date", "date_by", "sd_m", "sd_by")) for each in described["terrain"]]
    first, second = "nav.terrain.file[0]", "nav.terrain.file[1]"
    assert properties == [
        (None, None, 2.0, "nav.terrain.sd_m"),
        ("2019-05-01", first, 4.0, second),
        ("2000-02", second, 4.0, second),
    ]
    assert [layer["sd_m"] for layer in described["terrain_layers"]] == [4.0]
    assert main(["check", str(file)]) == 0
    output = capsys.readouterr().out
    assert f"date 2019-05-01 (from {first})" in output and f"sigma 4 m (from {second})" in output
    for old, new, text in (
        ('path = "tiles"', 'path = "tile"', "nav.terrain.file[1].path = '"),
        ('date = "2000-02"', 'date = "02/2000"', "nav.terrain.file[1].date = '02/2000': must be YYYY, YYYY-MM or"),
        ('date = "2000-02"', 'date = "2001-02-29"', "nav.terrain.file[1].date = '2001-02-29': there is no such day"),
        ("date = 2019-05-01", "", "nav.terrain.file[0]: needs at least one of vertical, sd_m and date"),
    ):
        file.write_text(BENCH + STATED.replace(old, new))
        assert main(["check", str(file)]) == 2
        assert text in capsys.readouterr().err


def test_land_cover_is_listed_with_what_altimeters_measure_over_it(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_ground(file.parent / "dem.tif", lambda lat, lon: 500.0 + 0.0 * lat * lon, "EPSG:32632", 20, 10.0)
    classes = np.full((4, 4), 10, dtype=np.uint8)
    write_tif(file.parent / "cover.tif", classes, "EPSG:4326", Affine(0.5, 0.0, LON - 1.0, 0.0, -0.5, LAT + 1.0))
    woods = '{ classes = [10], altimeter = "laser", bias_m = 17.0, sd_m = 5.0 }'
    water = '{ classes = [80, 90], altimeter = "laser", excluded = true }'
    text = LAND_COVER[: LAND_COVER.index("cover = [")]
    file.write_text(f"{BENCH}{text}cover = [{woods}, {water}]\n")
    assert main(["check", str(file)]) == 0
    output = capsys.readouterr().out
    assert f"land cover of {file.parent / 'cover.tif'}\n" in output
    assert "class 10      laser  17 m above the elevation, sigma 5 m\n" in output
    assert "class 80, 90  laser  no sample is used\n" in output


def test_a_missing_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(tmp_path / "none.toml")]) == 2
    assert "none.toml: cannot be read: No such file" in capsys.readouterr().err


def test_the_storage_plan_names_both_places_and_warns_of_one_medium(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(BENCH.replace('name = "bench"', 'name = "bench"\nfallback = "not/there/yet"'))
    assert main(["check", str(path), "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert [place["role"] for place in output["storage"]] == ["main", "fallback"]
    assert output["storage"][1]["directory"] == str(tmp_path / "not/there/yet")
    assert output["storage"][1]["free_mb"] > 0
    assert any("on the same medium" in warning for warning in output["warnings"])
    path.write_text(BENCH.replace('name = "bench"', 'name = "bench"\ndirectory = "d"\nfallback = "./d"'))
    assert main(["check", str(path)]) == 2
    assert "session.fallback" in capsys.readouterr().err


def test_a_device_whose_own_time_is_not_used_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(BENCH.replace("rate_hz = 25", "rate_hz = 25\nuse_device_time = false"))
    assert main(["check", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["devices"][0]["use_device_time"] is False
    assert main(["check", str(path)]) == 0
    assert "valid at arrival" in capsys.readouterr().out
    path.write_text(BENCH)
    main(["check", str(path)])
    assert "valid at arrival" not in capsys.readouterr().out


UDP = '[[link]]\nname = "net"\nkind = "udp"\nbind = "127.0.0.1:47999"\n'
BUS = '[[link]]\nname = "bus"\nkind = "can"\ninterface = "{}"\nchannel = "x"\nbitrate = 500000\n'


def hints_of(path: Path, text: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    path.write_text(f'[session]\nname = "x"\n{text}')
    assert main(["check", str(path), "--json"]) == 0
    texts: list[str] = json.loads(capsys.readouterr().out)["hints"]
    return texts


def test_a_computer_that_gives_sockets_little_is_a_hint(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "c.toml"
    monkeypatch.setattr(_receive_buffer, "granted_bytes", lambda: 2 * 212_992)  # what most distributions allow
    (hint,) = hints_of(path, UDP + BUS.format("socketcan"), capsys)
    for words in ("net, bus: ", "208 KiB", "4096", "about 512 unread datagrams of 100 B", "instead of 10082"):
        assert words in hint
    assert "sudo sysctl -w net.core.rmem_max=4194304" in hint
    assert main(["check", str(path)]) == 0
    assert "hint: net, bus: " in capsys.readouterr().out
    assert hints_of(path, BUS.format("slcan"), capsys) == []  # no socket there
    monkeypatch.setattr(_receive_buffer, "granted_bytes", lambda: 2 * 4_194_304)
    assert hints_of(path, UDP, capsys) == []


def test_what_a_socket_gets_is_read_from_the_kernel() -> None:
    granted, limit = _receive_buffer.granted_bytes(), int(Path("/proc/sys/net/core/rmem_max").read_text())
    assert granted in (2 * min(limit, RECEIVE_BUFFER), 2 * RECEIVE_BUFFER)


def test_it_reports_how_long_the_memory_of_snapshots_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "c.toml"
    line = '[[link]]\nname = "line"\nkind = "serial"\nport = "/dev/x"\nbaud = 115200\n'
    path.write_text(f'[session]\nname = "x"\nmode = "snapshot"\n[snapshot]\nbefore_s = 60.0\nmax_mb = 4.0\n{line}')
    assert main(["check", str(path), "--json"]) == 0
    shot = json.loads(capsys.readouterr().out)["snapshot"]
    # a full line brings 11520 B/s in 2 reads a message at the assumed 100 Hz; ticks come 50 times a second
    rate = 11520 + (2 * 100 + 50) * 22
    assert shot == {"before_s": 60.0, "after_s": 10.0, "max_mb": 4.0, "holds_s": round(4 * 2**20 / rate, 1)}
    assert main(["check", str(path)]) == 0
    output = capsys.readouterr().out
    assert "the links are recorded only on a trigger; 4 MB hold 246.4 s" in output


MISTAKES = """
[session]
name = "mistakes"

[[link]]
name = "line"
kind = "serial"
port = "/dev/ttyUSB0"

[[link]]
name = "eth"
kind = "udp"
bind = "0.0.0.0:4000"

[[device]]
name = "gnss"
link = "line"
driver = "novatel_oem6"
options = { logs = { bestpos = 1.0 } }

[[device]]
name = "one"
link = "eth"
driver = "mavlink"

[[device]]
name = "two"
link = "eth"
driver = "mavlink"
options = { system = 2 }

[nav]
position = ["gnss"]
attitude = ["one", "two"]
"""
REMEDIES = {
    "device[0].driver: requests data from gnss, but link line may not send": (
        '/dev/ttyUSB0"',
        '/dev/ttyUSB0"\ntransmit = true',
    ),
    "link[1].bind = '0.0.0.0:4000': receives from every network": ("0.0.0.0", "127.0.0.1"),
    "nav.attitude: one, two share link eth": ('["one", "two"]', '["one"]'),
    "nav.position: gnss is compared with no other source": ('["gnss"]', '["gnss", "one"]'),
}


def warnings(path: Path, text: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    path.write_text(text)
    assert main(["check", str(path), "--json"]) == 0
    found: list[str] = json.loads(capsys.readouterr().out)["warnings"]
    return found


@pytest.mark.parametrize(("begin", "remedy"), REMEDIES.items(), ids=[text.split(":")[0] for text in REMEDIES])
def test_what_will_probably_not_work_is_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], begin: str, remedy: tuple[str, str]
) -> None:
    before = warnings(tmp_path / "own.toml", MISTAKES, capsys)
    assert len(before) == len(REMEDIES)
    (warning,) = [text for text in before if text.startswith(begin)]
    assert MISTAKES.count(remedy[0]) == 1
    after = warnings(tmp_path / "own.toml", MISTAKES.replace(*remedy), capsys)
    assert [re.sub("line [0-9]+", "", text) for text in after] == [
        re.sub("line [0-9]+", "", text) for text in before if text != warning
    ]


def test_a_warning_has_file_line_and_device(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "own.toml"
    path.write_text(MISTAKES)
    assert main(["check", str(path)]) == 0
    line = MISTAKES.splitlines().index('driver = "novatel_oem6"') + 1
    (warning,) = [text for text in capsys.readouterr().out.splitlines() if "requests data" in text]
    assert warning.startswith(f"warning: {path}: device[0].driver: ")
    assert warning.endswith(f"(line {line}, device 'gnss')")


#: Valid, and without a warning as it is.
SOUND = """
[session]
name = "sound"

[[link]]
name = "a"
kind = "serial"
port = "/dev/ttyUSB0"

[[link]]
name = "b"
kind = "serial"
port = "/dev/ttyUSB1"

[[device]]
name = "ins"
link = "a"
driver = "imar_ixcom"

[[device]]
name = "gnss"
link = "b"
driver = "nmea0183"

[[device]]
name = "radar"
link = "a"
driver = "freeflight_ra4500"
[device.altimeter]
kind = "radar"
range_m = [0, 800]

[nav]
position = ["ins", "gnss"]
attitude = ["ins"]
altimeters = ["radar"]

[nav.filter]
imu = "ins"
gnss = ["gnss"]

[nav.limits]
speed_mps = 100
"""
SPARE_ALTIMETER = """
[[device]]
name = "laser"
link = "b"
driver = "lightware_ascii"
options = { query = "none" }
altimeter = { kind = "laser", range_m = [0, 100] }
"""
#: What is replaced in SOUND, and the begin of the only warning; the bounds are those of the tests in fti.nav.
WITHOUT_EFFECT = (
    ("speed_mps = 100", "speed_mps = 600", "nav.limits.speed_mps = 600: refuses nothing"),
    ("speed_mps = 100", "speed_mps = 60", "nav.limits.wind_mps = 40: headings are compared with the track only above"),
    ("speed_mps = 100", "undulation_m = 107", "nav.limits.undulation_m = 107: refuses nothing"),
    ("[nav.limits]", "[nav.alert_limits]\nposition_m = 9600\n[nav.limits]", "nav.alert_limits.position_m = 9600: "),
    ("[0, 800]", "[0, 800]\nmax_roll_deg = 180", "device[2].altimeter.max_roll_deg = 180: refuses nothing"),
    ("[0, 800]", "[0, 800]\nmax_dispersion = 0.2", "device[2].altimeter.max_dispersion: refuses nothing without"),
    ('["gnss"]', '["gnss"]\naltimeters = ["radar"]', "nav.filter.altimeters: never aid"),
    (
        "[nav.limits]",
        '[nav.radio]\nreceiver = "gnss"\naltimeter = "radar"\n[nav.limits]',
        "nav.radio.altimeter: is never",
    ),
    ('["ins", "gnss"]', '["ins", "gnss", "ins"]', "nav.position: ins is named twice"),
    ('gnss = ["gnss"]\n', "", "nav.filter: has no gnss"),
    ('["ins", "gnss"]', '["ins"]', "nav.filter.imu: ins and all devices of nav.position are on link a"),
    ('gnss = ["gnss"]', 'gnss = ["gnss"]\nbaro = ["ins", "radar"]', "nav.filter.baro: ins, radar share link a"),
    ("[nav.limits]", "[nav.radio]\n[nav.limits]", "nav.radio: has no receiver and fewer than two stations"),
    (
        'position = ["ins", "gnss"]',
        'position = ["gnss"]\nradio.receiver = "gnss"',
        "nav.radio.receiver: gnss and all devices of nav.position are on link b",
    ),
    (
        'driver = "nmea0183"',
        'driver = "nmea0183"\nlever_arm_b = [400, 0, -51]',
        "device[1].lever_arm_b = [400, 0, -51]: longer than 50 m: metres, not millimetres?",
    ),
    ("[nav]", SPARE_ALTIMETER + "[nav]", "device[3].altimeter: is not used: laser is not in nav.altimeters"),
)


def test_limits_and_fallbacks_without_effect_are_warnings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert warnings(tmp_path / "own.toml", SOUND, capsys) == []
    for old, new, begin in WITHOUT_EFFECT:
        assert SOUND.count(old) == 1, old
        found = warnings(tmp_path / "own.toml", SOUND.replace(old, new), capsys)
        assert [text[: len(begin)] for text in found] == [begin]
        assert "(line " in found[0]


@pytest.mark.parametrize(
    ("spacing_m", "height_m", "altimeter", "begin"),
    [
        (990.0, 0.0, "", None),
        (1010.0, 0.0, "", "device[0].altimeter: posts of the terrain are 101"),  # 100 times the 10 m of a radar
        (1010.0, 0.0, "max_deviation_m = 20", None),
        (50.0, 15.0, "", None),  # 15 sqrt(8 / 45) = 6.3 m RMS of resampling: three sigma are 19.5 m, with sd_m of 1.5 m
        (50.0, 17.0, "", "device[0].altimeter: is never compared with the ground"),
    ],
)
def test_terrain_that_is_too_coarse_for_an_altimeter_is_a_warning(
    file: Path,
    capsys: pytest.CaptureFixture[str],
    spacing_m: float,
    height_m: float,
    altimeter: str,
    begin: str | None,
) -> None:
    def ridges(lat: Array, lon: Array) -> Array:
        return np.where(np.arange(lat.shape[0])[:, None] % 2 == 0, 500.0 - height_m, 500.0 + height_m) + 0.0 * lon

    write_ground(file.parent / "dem.tif", ridges, "EPSG:32632", 100, spacing_m)
    terrain = '[nav]\nterrain = { files = ["dem.tif"], vertical = "ellipsoid" }'
    limits = f"range_m = [0, 800]{', ' if altimeter else ''}{altimeter}"
    found = warnings(file, BENCH.replace("[nav]", terrain).replace("range_m = [0, 800]", limits), capsys)
    assert [text for text in found if "device[0].altimeter" in text and not text.startswith(begin or " ")] == []
    assert any(text.startswith(begin or "links ") for text in found)


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "configs").glob("*.toml")))
def test_shipped_configurations_have_no_warning(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(ROOT / "configs" / f"{name}.toml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["warnings"]
    assert [text.split(":")[0] for text in found] == (["nav.position"] if name == "bench" else [])  # one receiver


def test_the_filter_and_the_position_from_the_ground_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(ROOT / "configs" / "terrain_position.toml")]) == 0
    printed = capsys.readouterr().out
    assert "filter      ins, aided by receiver, air_data" in printed
    assert "ground      profiles of altimeter, 15 s each, aid the filter" in printed


def test_a_multi_beam_altimeter_is_listed_with_the_position_from_the_ground(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(ROOT / "configs" / "terrain_position_beams.toml")]) == 0
    assert "ground      profiles of altimeter with all beams, 15 s each, aid the filter" in capsys.readouterr().out


LAND_COVER = """
[nav.terrain]
files = ["dem.tif"]
vertical = "ellipsoid"
land_cover = "cover.tif"
cover = [{ classes = [10], altimeter = "laser", sd_m = 5.0 }, { classes = [10], altimeter = "multibeam", sd_m = 5.0 }]
"""


def test_land_cover_of_another_altimeter_and_unused_beams_are_warnings(tmp_path: Path) -> None:
    text = (ROOT / "configs" / "terrain_position_beams.toml").read_text().replace("terrain = {", "# {") + LAND_COVER
    file, (before, table, after) = tmp_path / "beams.toml", text.partition("[nav.terrain_position]")
    file.write_text(text)
    used = list(limit_warnings(config.load(file), ()))
    file.write_text(before + after[after.index("\n[") :])
    unused = list(limit_warnings(config.load(file), ()))
    assert table
    assert [each for each in used if "cover" in each] == [
        "nav.terrain.cover[0].altimeter = 'laser': is not used: [nav.terrain_position] uses a multibeam altimeter; "
        "change it, or remove the table"
    ]
    assert len([each for each in unused if "cover" in each and "is not configured" in each]) == 2
    assert any(each.startswith("device[0].altimeter: is not used: [nav.terrain_position]") for each in unused)


@pytest.mark.parametrize(
    ("before", "after", "error"),
    [
        ('position = ["receiver"]', 'position = ["receiver"]\naltimeters = ["altimeter"]', "gives no height"),
        ('driver = "multibeam_altimeter"', 'driver = "nmea0183"', "drivers that do: multibeam_altimeter"),
        ('altimeter = "altimeter"\n', 'altimeter = "ins"\n', "'ins' is neither in nav.altimeters nor a multi-beam"),
    ],
)
def test_a_wrong_multi_beam_altimeter_is_one_sentence(
    before: str, after: str, error: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "configs" / "terrain_position_beams.toml").read_text()
    assert before in text
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(text.replace(before, after))
    assert main(["check", str(wrong)]) == 2
    assert error in capsys.readouterr().err


@pytest.mark.parametrize(
    ("before", "after", "error"),
    [
        ("[nav.filter]\nimu", "[nav.limits]\n#", "nav.terrain_position: needs [nav.filter]"),
        (
            'altimeter = "altimeter"',
            'altimeter = "laser"',
            "'laser' is neither in nav.altimeters nor a",
        ),
        ("window_s = 15.0", "window_s = 500.0", "nav.terrain_position.window_s = 500"),
    ],
)
def test_a_wrong_position_from_the_ground_is_one_sentence(
    before: str, after: str, error: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "configs" / "terrain_position.toml").read_text()
    assert before in text
    wrong = tmp_path / "wrong.toml"
    lines = text.replace(before, after).splitlines()
    of_filter = ('gnss = ["receiver"]', 'baro = "air_data"')
    wrong.write_text("\n".join(line for line in lines if "limits" not in after or line not in of_filter))
    assert main(["check", str(wrong)]) == 2
    assert error in capsys.readouterr().err


def error_of_changed(name: str, before: str, after: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """What fti check says of a shipped configuration with the first of such texts replaced."""
    text = (ROOT / "configs" / name).read_text()
    assert before in text
    wrong = folder / "wrong.toml"
    wrong.write_text(text.replace(before, after, 1))
    assert main(["check", str(wrong)]) == 2
    return capsys.readouterr().err


def test_the_drift_over_the_ground_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(ROOT / "configs" / "scan_drift.toml")]) == 0
    printed = capsys.readouterr().out
    assert "drift       images of imager that overlap by half aid the filter after they have agreed" in printed


@pytest.mark.parametrize(
    ("before", "after", "error"),
    [
        ('gnss = ["receiver"]', "gnss = []", "nav.scan_drift: needs [nav.filter] with gnss"),
        ('device = "imager"', 'device = "imagr"', "nav.scan_drift.device: "),
        ('device = "imager"', 'device = "receiver"', "ublox_ubx gives no scans; drivers that do: velodyne_vlp16, and"),
        ("range_sd_m = 0.05", "exposure_s = 0.1", "exposure_s = 0.1: a scan is a whole image; must be 0"),
        ("range_sd_m = 0.05", "exposure_s = 0.5", "nav.scan_drift.exposure_s = 0.5"),
        ("range_sd_m = 0.05", "range_sd_m = 0", "nav.scan_drift.range_sd_m = 0"),
        ("range_sd_m = 0.05", "interval_s = 1", "nav.scan_drift.interval_s"),
        ("rows = 75 ", 'grid = "lines"\nrows = 75 ', "gives lines, which do not overlap with those of an earlier time"),
    ],
)
def test_a_wrong_drift_over_the_ground_is_one_sentence(
    before: str, after: str, error: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert error in error_of_changed("scan_drift.toml", before, after, tmp_path, capsys)


def test_two_line_scanners_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(ROOT / "configs" / "scan_drift_pair.toml")]) == 0
    assert "drift       strips of 1.5 s, of front and later of rear, aid the filter" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("before", "after", "error"),
    [
        ('second_device = "rear"', "", "or second_device a line scanner that looks back"),
        ('second_device = "rear"', 'second_device = "raer"', "nav.scan_drift.second_device: "),
        ('second_device = "rear"', 'second_device = "front"', "is the device; must be the rear line scanner"),
        (
            'second_device = "rear"',
            'second_device = "receiver"',
            "second_device = 'receiver': ublox_ubx gives no scans",
        ),
        ("exposure_s = 1.5", "", "exposure_s = 0: a scan of front is a line; must be the duration of a strip"),
        ("exposure_s = 1.5", "exposure_s = 2", "nav.scan_drift.exposure_s = 2"),
        ("[0.0, 15.0, 0.0]", "[0.0, 165.0, 0.0]", "'front': the middle of its lines is not below the aircraft"),
        ("[0.0, -15.0, 0.0]", "[0.0, 15.0, 0.0]", "'front': its lines are no further ahead than those of rear"),
        (
            'grid = "lines"\nrows = 1\ncolumns = 200\nfield_of_view_deg = [0, 60]',
            "rows = 10\ncolumns = 20\nfield_of_view_deg = [60, 60]",
            "device = 'front': gives no lines; only two",
        ),
    ],
)
def test_a_wrong_pair_of_line_scanners_is_one_sentence(
    before: str, after: str, error: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert error in error_of_changed("scan_drift_pair.toml", before, after, tmp_path, capsys)


def test_a_scanner_that_turns_needs_the_duration_of_a_look(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "configs" / "scan_drift.toml").read_text()
    begin, end = text.index('driver = "binary_struct"'), text.index('[[device]]\nname = "ins"')
    file = tmp_path / "scanner.toml"
    text = text[:begin] + 'driver = "velodyne_vlp16"\nrate_hz = 754\nmax_age_ms = 500\n\n' + text[end:]
    file.write_text(text)
    assert main(["check", str(file)]) == 2
    assert "exposure_s = 0: a scan of velodyne_vlp16 is a part of a turn" in capsys.readouterr().err
    file.write_text(text.replace("range_sd_m = 0.05", "exposure_s = 0.2"))
    assert main(["check", str(file)]) == 0
    assert "drift       looks of 0.2 s of imager that overlap by half" in capsys.readouterr().out
