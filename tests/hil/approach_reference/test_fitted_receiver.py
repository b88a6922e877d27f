"""The file of a fit in ``fti reference make``: its keys, and the instrument that they describe."""

import math
from pathlib import Path

import numpy as np
import pytest

from fti.errors import ConfigError, MissingError
from fti.hil.approach_reference.approaches import LASER, RA4500
from fti.hil.approach_reference.fitted_receiver import make_receiver, read_fitted
from fti.hil.approach_reference.receivers import ReceiverVariant, measure
from fti.ranging.sensor import sensor_poses
from fti.terrain.terrain import Terrain

HEIGHT_M, BANK = 200.0, math.radians(45.0)


def ranges(receiver: ReceiverVariant) -> float:
    """Banked by 45 degrees over level ground, 200 m below."""
    terrain = Terrain.from_array(np.zeros((101, 101)), 100.0, east0=-5000.0, north0=-5000.0)
    poses = sensor_poses(terrain.frame, (0.0, 0.0, HEIGHT_M), (BANK, 0.0, 0.0))
    return float(measure((receiver,), terrain, poses, np.zeros((1, 2)))[0, 0, 0])


def written(folder: Path, text: str) -> Path:
    (folder / "receiver.toml").write_text("[device.altimeter]\n" + text)
    return folder / "receiver.toml"


@pytest.mark.parametrize("beam_deg", [40.0, 60.0])
def test_beam_bias_and_scale_are_those_of_the_file(tmp_path: Path, beam_deg: float) -> None:
    """The nearest point of a cone of the half width b lies at h / cos(45 deg - b)."""
    keys = read_fitted(written(tmp_path, f'model = "nearest"\nbeam_deg = {beam_deg}\nbias_m = 2.0\nscale = 1.01\n'))
    nearest = HEIGHT_M / math.cos(BANK - math.radians(beam_deg / 2.0))
    assert ranges(make_receiver(RA4500.sensor, keys)) == pytest.approx(1.01 * nearest + 2.0, rel=0.02)


def test_a_deeper_threshold_sees_farther_up(tmp_path: Path) -> None:
    """A leading edge at -20 dB hears ground that is nearer, farther off the boresight, than one at -3 dB."""
    values = [
        ranges(
            make_receiver(RA4500.sensor, read_fitted(written(tmp_path, f'model = "beam"\nthreshold_db = {level}\n')))
        )
        for level in (-20.0, -3.0)
    ]
    assert HEIGHT_M - 1.0 < values[0] < values[1] - 5.0


def test_a_laser_stays_one(tmp_path: Path) -> None:
    receiver = make_receiver(LASER.sensor, read_fitted(written(tmp_path, "bias_m = -0.5\n")))
    assert ranges(receiver) == pytest.approx(HEIGHT_M / math.cos(BANK) - 0.5, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("beam_deg = 400\n", "receiver.toml: device.altimeter.beam_deg = 400"),
        ("width = 40\n", "receiver.toml: device.altimeter.width"),
        ('model = "wide"\n', "device.altimeter.model = 'wide'"),
    ],
)
def test_what_is_no_receiver_is_refused_with_its_key(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        read_fitted(written(tmp_path, text))
    assert message in str(error.value)


def test_a_file_without_the_table_and_one_that_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text("[session]\n")
    with pytest.raises(ConfigError, match=r"other.toml: device.altimeter: is missing; fti reference fit --out writes"):
        read_fitted(tmp_path / "other.toml")
    with pytest.raises(MissingError, match=r"none.toml: cannot be read"):
        read_fitted(tmp_path / "none.toml")
