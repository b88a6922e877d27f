"""A short accelerated flight of three serial devices over a flat country, and its score."""

from __future__ import annotations

from pathlib import Path

from fti import config
from fti.config import Config
from fti.hil.environment import Environment
from fti.hil.scenario import Scenario
from fti.logger.reading.recording import Recording
from fti.post.offline_run import fly
from fti.post.reprocess import Setup
from fti.post.score.comparison import Score
from fti.post.score.session_score import score_session
from tests.hil.worlds import flat_terrain, path, scenario

DURATION_S = 38.0
CONFIG = """
[session]
name = "short"
directory = "unused"

[[link]]
name = "radalt_line"
kind = "serial"
port = "/dev/unused"

[[link]]
name = "gnss_line"
kind = "serial"
port = "/dev/unused"

[[link]]
name = "spare_line"
kind = "serial"
port = "/dev/unused"

[[device]]
name = "altimeter"
link = "radalt_line"
driver = "freeflight_ra4500"
rate_hz = 10
max_age_ms = 500
options = { checksum = "xor" }

[device.altimeter]
kind = "radar"
range_m = [0.5, 762]

[[device]]
name = "gnss"
link = "gnss_line"
driver = "nmea0183"
rate_hz = 5
max_age_ms = 1000
use_device_time = false

[[device]]
name = "spare"
link = "spare_line"
driver = "nmea0183"
rate_hz = 5
max_age_ms = 1000
use_device_time = false

[nav]
position = ["gnss", "spare"]
altimeters = ["altimeter"]
"""
FAULTS = (
    {"kind": "wrong_checksum", "devices": ("altimeter",), "from_s": 8, "to_s": 12},
    {"kind": "cut", "devices": ("altimeter",), "from_s": 19, "to_s": 23},
    {"kind": "invalid", "devices": ("altimeter",), "flags": ("unlocked",), "from_s": 30, "to_s": 32},
    {"kind": "gnss_outage", "devices": ("gnss",), "from_s": 8, "to_s": 11},
    {"kind": "clock_jump", "devices": ("gnss",), "by_s": 3, "from_s": 24, "to_s": 30},
    {"kind": "duplicated", "devices": ("spare",), "from_s": 8, "to_s": 15.5},
)


def daemon_config(folder: Path, text: str = CONFIG) -> Config:
    """The configuration, from a file."""
    file = folder / "short.toml"
    file.write_text(text)
    return config.load(file)


def short_scenario(faults: tuple[dict[str, object], ...] = FAULTS, **keys: object) -> Scenario:
    """A scenario of these faults."""
    return scenario(flight={"kind": "approach", "duration_s": DURATION_S}, fault=faults, **keys)


def session_of(flight: Scenario, folder: Path, text: str = CONFIG) -> Path:
    """The session of a flight with a configuration."""
    world = Environment(flight, path(), flat_terrain(), undulation=47.0)
    return fly(daemon_config(folder, text), flight, folder / "out", world=world)


def score_of(flight: Scenario, session: Path, setup: Setup | None = None) -> Score:
    """Its score.  given : by this configuration"""
    recording = Recording.open(session)
    (score,) = score_session(recording, flight, recording.truth_files, setup)
    return score
