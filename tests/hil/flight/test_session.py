"""A flight from a session: the path of P and its attitude, from what a device said; what a session does not have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fti import config as configuration
from fti.config import Config
from fti.errors import ConfigError, MissingError
from fti.hil.environment import Environment
from fti.hil.flight.session import read_session
from fti.hil.flight.smoothing import displacements
from fti.hil.flight.trajectory import FlightSamples
from fti.post import offline_run
from tests.hil.worlds import flat_terrain, path, scenario, world

CONFIG = """
[session]
name = "flown"
directory = "."
[[link]]
name = "ins_eth"
kind = "udp"
bind = "127.0.0.1:0"
[[link]]
name = "gnss_line"
kind = "serial"
port = "/dev/null"
baud = 115200
[[device]]
name = "ins"
link = "ins_eth"
driver = "imar_ixcom"
rate_hz = 50
max_age_ms = 500
latency_ms = 4
lever_arm_b = [20.0, 5.0, -10.0]
[[device]]
name = "gnss"
link = "gnss_line"
driver = "nmea0183"
rate_hz = 5
max_age_ms = 500
latency_ms = 10
[nav]
attitude = ["ins"]
position = ["ins", "gnss"]
"""
FLIGHT_S = 12.0


def config_of(folder: Path, text: str = CONFIG) -> Config:
    (folder / "daemon.toml").write_text(text)
    return configuration.load(folder / "daemon.toml")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("flown")
    return offline_run.fly(config_of(folder), scenario(), folder, world=world(FLIGHT_S))


def test_the_path_of_p_and_its_attitude_are_found(session: Path) -> None:
    """Within what the device itself is off: a metre or so, a tenth of a degree; not by its lever arm, 23 m here."""
    samples = read_session(session, "ins")
    assert len(samples.t) == pytest.approx(50 * FLIGHT_S, abs=20)
    assert samples.t[0] == 0.0
    assert np.diff(samples.t).max() < 0.03
    truth = world(FLIGHT_S)
    first = _first(samples, truth)
    state = truth.state(first + samples.t[20:-20])
    part = FlightSamples(
        *(getattr(samples, name)[20:-20] for name in ("t", "lat", "lon", "alt", "roll", "pitch", "heading"))
    )
    metres, angles = displacements(part, state)
    assert metres.max() < 5.0
    assert np.rad2deg(angles.max()) < 0.5


def _first(samples: FlightSamples, truth: Environment) -> float:
    """When the first sample was taken, by the course of the flight [s]."""
    t = np.arange(0.0, 0.2, 0.001)
    return float(t[np.argmin(np.abs(truth.state(t).lon - samples.lon[0]))])


def test_it_is_flown_again(session: Path) -> None:
    flight = {"kind": "recorded", "file": str(session), "smooth_s": 2, "from_s": 1, "duration_s": 8}
    again = Environment(scenario(flight=flight), path(), flat_terrain(100.0), undulation=47.0)
    state, truth = again.state(np.arange(1.0, 7.0, 0.5)), world(FLIGHT_S).state(np.arange(2.0, 8.0, 0.5))
    assert np.abs(np.rad2deg(state.pitch - truth.pitch)).max() < 0.5
    assert np.abs(state.vel_n - truth.vel_n).max() < 2.0
    assert again.remarks[0].startswith(f"{session.name}: filtered minus recorded: 0.")


def test_the_only_device_that_says_both_need_not_be_named(session: Path) -> None:
    np.testing.assert_array_equal(read_session(session, None).lat, read_session(session, "ins").lat)


@pytest.mark.parametrize(
    ("device", "error"),
    [
        ("gnss", "no position with attitude from gnss"),
        ("radar", "unknown device 'radar'; the session has ins, gnss"),
    ],
)
def test_missing_measurements_of_a_device_are_reported(session: Path, device: str, error: str) -> None:
    with pytest.raises(ConfigError, match=error):
        read_session(session, device)


def test_with_two_devices_that_have_both_one_must_be_named(tmp_path: Path) -> None:
    second = CONFIG.replace(
        '"gnss_line"\ndriver = "nmea0183"\nrate_hz = 5', '"gnss_line"\ndriver = "imar_ixcom"\nrate_hz = 5'
    )
    folder = offline_run.fly(config_of(tmp_path, second), scenario(), tmp_path, world=world(2.0))
    with pytest.raises(ConfigError, match="several devices have position and attitude; name one of ins, gnss"):
        read_session(folder, None)


def test_a_folder_that_is_not_a_session_is_reported(tmp_path: Path) -> None:
    with pytest.raises(MissingError):
        read_session(tmp_path, None)
