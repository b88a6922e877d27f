"""The table of a recorded flight: there and back, and every mistake with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fti.errors import ConfigError, MissingError
from fti.hil.flight.recorded_flight import read_table, write_table
from fti.hil.flight.trajectory import FlightSamples

HEADER = "t_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg\n"


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "flight.csv"
    file.write_text(text)
    return file


def test_there_and_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    t = np.arange(20.0) / 5.0
    angles = rng.uniform(-1.5, 1.5, (4, 20))
    heading = rng.uniform(0.0, 6.28, 20)
    samples = FlightSamples(t, angles[0], angles[1], 1000.0 * angles[2] + 600.0, angles[2], angles[3], heading)
    write_table(samples, tmp_path / "flight.csv", ["somebody's", "flight"])
    result = read_table(tmp_path / "flight.csv")
    for name, atol in [("t", 1e-12), ("lat", 2e-11), ("lon", 2e-11), ("alt", 6e-4), ("roll", 1e-7), ("heading", 1e-7)]:
        np.testing.assert_allclose(getattr(result, name), getattr(samples, name), atol=atol, err_msg=name)


def test_columns_stand_in_any_order_and_others_are_not_read(tmp_path: Path) -> None:
    text = (
        "# a remark\n\nheading_deg, engine, t_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg\n90,on,1.5,45,-120,300,-10,5\n"
    )
    samples = read_table(written(tmp_path, text))
    assert (samples.t[0], samples.alt[0]) == (1.5, 300.0)
    np.testing.assert_allclose([samples.lat[0], samples.lon[0], samples.heading[0]], np.deg2rad([45.0, -120.0, 90.0]))
    np.testing.assert_allclose([samples.roll[0], samples.pitch[0]], np.deg2rad([-10.0, 5.0]))


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", r"flight\.csv: no table found; the first line must name the columns t_s, lat_deg"),
        ("# x\nt_s,lat_deg,alt_m\n", r"flight\.csv: line 2: missing columns lon_deg, roll_deg, pitch_deg, heading_deg"),
        (HEADER + "0,1,2,3,4,5\n", r"line 2: 6 values under 7 columns"),
        (HEADER + "0,1,2,3,4,5,6\n0,1,2,high,4,5,6\n", r"line 3: alt_m = 'high': is not a number"),
        (HEADER + "0,1,2,nan,4,5,6\n", r"line 2: alt_m = nan: must be a number"),
        (HEADER + "0,91,2,3,4,5,6\n", r"line 2: lat_deg = 91: must be a number up to 90"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path: Path, text: str, error: str) -> None:
    with pytest.raises(ConfigError, match=error):
        read_table(written(tmp_path, text))


def test_a_table_of_a_spreadsheet_begins_with_a_mark(tmp_path: Path) -> None:
    file = tmp_path / "flight.csv"
    file.write_text(HEADER + "0,1,2,3,4,5,6\n", encoding="utf-8-sig")
    assert read_table(file).t.tolist() == [0.0]


def test_no_file_and_no_text_are_reported(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match=r"none\.csv: cannot be read: No such file"):
        read_table(tmp_path / "none.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(MissingError, match="is not UTF-8"):
        read_table(tmp_path / "binary.csv")
