"""``fti reference fit``: finds the receiver model of an emulated flight over hills."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path

import numpy as np
import pytest

from fti import config as configuration
from fti.cli.main import main
from fti.config import Config
from fti.hil.environment import Environment
from fti.hil.tables.schema import SensorSettings
from fti.post import offline_run
from fti.terrain.files.open_terrain import open_terrain
from tests.hil.worlds import path, scenario
from tests.terrain.elevation_files import Array, write_ground

LAT, LON = 48.0, 11.0
GROUND_M = 500.0
BEAM_DEG, BIAS_M, SCALE = 60.0, 2.0, 1.01

CONFIG = """
[session]
name = "hills"
directory = "."

[[link]]
name = "radalt_line"
kind = "serial"
port = "/dev/null"
baud = 115200

[[link]]
name = "ins_eth"
kind = "udp"
bind = "127.0.0.1:0"

[[device]]
name = "altimeter"
link = "radalt_line"
driver = "freeflight_ra4500"
rate_hz = 25
latency_ms = 20

[device.altimeter]
kind = "radar"
range_m = [0.5, 762]
beam_deg = 40

[[device]]
name = "ins"
link = "ins_eth"
driver = "imar_ixcom"
rate_hz = 50
latency_ms = 4

[nav]
attitude = ["ins"]
position = ["ins"]
altimeters = ["altimeter"]
terrain = { files = ["hills.tif"], vertical = "ellipsoid" }
"""

#: North and east [m], height [m]: turns over the hills, 70 to 290 m above them: the RA-4500 has steps of 5 ft and less
#: up to 152 m, of 20 ft beyond.
WAYPOINTS = [(-1500.0, -1700.0, 600.0), (-1400.0, 400.0, 720.0), (600.0, 700.0, 620.0), (1000.0, -1600.0, 760.0)]


def hills(lat: Array, lon: Array) -> Array:
    """Waves of 500 and 380 m, 30 m high."""
    north, east = (lat - LAT) * 111_200.0, (lon - LON) * 74_500.0
    return np.asarray(GROUND_M + 30.0 * np.sin(north / 80.0) * np.cos(east / 60.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fit")


@pytest.fixture(scope="module")
def config(folder: Path) -> Config:
    write_ground(folder / "hills.tif", hills, "EPSG:32632", 500, 12.0, at=(LAT, LON))
    (folder / "daemon.toml").write_text(CONFIG.replace("hills.tif", str(folder / "hills.tif")))
    return configuration.load(folder / "daemon.toml")


@pytest.fixture(scope="module")
def session(folder: Path, config: Config) -> Path:
    """The configuration has a beam of 40 degrees and an altimeter that is right."""
    points = [
        {"lat_deg": LAT + north / 111_200.0, "lon_deg": LON + east / 74_500.0, "alt_m": alt, "speed_mps": 50.0}
        for north, east, alt in WAYPOINTS
    ]
    truth = {"beam_deg": BEAM_DEG, "bias_m": BIAS_M, "scale": SCALE}
    plan = scenario(
        flight={"kind": "waypoints", "waypoint": tuple(points), "bank_deg": 30.0},
        sensor={"altimeter": SensorSettings.model_validate(truth)},
        seed=4,
    )
    terrain = open_terrain([str(folder / "hills.tif")], vertical="ellipsoid")
    return offline_run.fly(config, plan, folder, world=Environment(plan, path(), terrain, undulation=47.0))


@pytest.fixture(scope="module")
def fit_output(session: Path, folder: Path) -> str:
    """What the command prints; it has written receiver.toml and fit.png."""
    out = folder / "receiver.toml"
    words = ["reference", "fit", str(session), "--model", "nearest", "--samples", "800", "--out", str(out)]
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        assert main([*words, "--json", "--plot", str(folder / "fit.png")]) == 0
    return printed.getvalue()


def test_the_receiver_that_was_flown_is_found(fit_output: str, folder: Path) -> None:
    out = folder / "receiver.toml"
    content = json.loads(fit_output[: fit_output.rindex("}") + 1])
    true = {"beam_deg": BEAM_DEG, "bias_m": BIAS_M, "scale": SCALE}
    for name, value in true.items():
        one = content["parameters"][name]
        assert one["value"] == pytest.approx(value, abs=3.0 * one["sd"]), name
        assert not one["assumed"]
    parameters = content["parameters"]
    assert parameters["beam_deg"]["sd"] < 4.0
    assert parameters["scale"]["sd"] < 0.015
    assert parameters["bias_m"]["value"] == pytest.approx(BIAS_M, abs=1.5)  # the sigma is that of the inertial height
    assert content["rms_after_m"] < 0.6 * content["rms_before_m"]
    assert content["samples_available"] > 1500
    assert (folder / "fit.png").stat().st_size > 10_000
    table = configuration.parse_toml(out.read_text(), str(out))["device"]["altimeter"]
    assert table["beam_deg"] == pytest.approx(parameters["beam_deg"]["value"], abs=0.006)


@pytest.mark.usefixtures("fit_output")
def test_what_is_written_makes_the_live_prediction_right(session: Path, folder: Path) -> None:
    """Reprocessed with the keys of the fit, measured minus predicted has no bias any more and is half as large."""
    from fti.logger.reading.recording import Recording

    keys = (folder / "receiver.toml").read_text().split("[device.altimeter]\n")[1]
    (folder / "fitted.toml").write_text(CONFIG.replace("beam_deg = 40\n", keys.replace('model = "nearest"\n', "")))
    assert main(["reprocess", str(session), str(folder / "fitted.toml"), "--out", str(folder / "again")]) == 0
    (again,) = (folder / "again").iterdir()

    def deviations(of: Path) -> Array:
        outputs = [json.loads(data) for _, _, _, _, data in Recording.open(of).messages("/nav/height_above_ground/")]
        both = [(o["raw"], o["predicted"]) for o in outputs if o["raw"] is not None and o["predicted"] is not None]
        return np.array([raw - predicted for raw, predicted in both])

    before, after = deviations(session), deviations(again)
    assert abs(float(np.median(before))) > 1.0
    assert abs(float(np.median(after))) < 0.5
    assert float(np.sqrt(np.mean(after**2))) < 0.6 * float(np.sqrt(np.mean(before**2)))


def test_for_people(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reference", "fit", str(session), "--model", "nearest", "--samples", "300"]) == 0
    output = capsys.readouterr().out
    assert "  beam_deg      " in output
    assert "(configured: 40)" in output
    assert "m RMS as configured, " in output


def test_mistakes_are_one_sentence_with_file_and_key(
    session: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def error_of(*words: str) -> str:
        assert main(["reference", "fit", *words]) == 2
        printed = capsys.readouterr().err
        assert printed.count("\n") == 1
        return printed

    assert "nowhere" in error_of(str(folder / "nowhere"))
    assert f"{session}: device: no altimeter 'radar'; name one with --sensor" in error_of(
        str(session), "--sensor", "radar"
    )
    bare = folder / "bare.toml"
    bare.write_text(CONFIG.replace('terrain = { files = ["hills.tif"], vertical = "ellipsoid" }\n', ""))
    assert f"{bare}: nav.terrain: is missing" in error_of(str(session), "--config", str(bare))
    assert "is a folder" in error_of(str(session), "--out", str(folder))
