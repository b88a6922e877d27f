"""The configuration for the score of a flight, and sessions that have another one."""

from __future__ import annotations

from pathlib import Path

import pytest

from fti import config as configuration
from fti.devices import read_texts
from fti.errors import MissingError
from fti.hil.scenario import Scenario
from fti.logger.reading.mcap_file import McapFile
from fti.logger.session import CONFIG_ATTACHMENT
from fti.post.reprocess import other_setup
from fti.post.score.comparison import Score
from fti.post.score.outcome import FlightOutcome
from fti.post.score.reference_setup import differences
from fti.post.score.report import as_text
from fti.post.score.rows import CONFIGURATION, Result
from tests.helpers import ROOT
from tests.post.score.edited_sessions import DERIVED, RAW, TRUTH, copy_session, file_of, rewrite
from tests.post.score.short_flight import CONFIG, score_of, session_of, short_scenario

CUT = ({"kind": "cut", "devices": ("altimeter",), "from_s": 10.0, "to_s": 13.0},)
DOUBLED = ({"kind": "duplicated", "devices": ("spare",), "from_s": 8.0, "to_s": 15.5},)
NO_ALTIMETERS = CONFIG.replace('altimeters = ["altimeter"]', "altimeters = []")
SPARE = CONFIG[CONFIG.index('[[device]]\nname = "spare"') : CONFIG.index("[nav]")]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The session of a flight; the configuration that its scenario names is not to be had."""
    return session_of(short_scenario(CUT), tmp_path_factory.mktemp("flown"))


def recorded_with(session: Path, out: Path, text: str) -> Path:
    """The same, with another configuration in its raw and derived files."""
    copy = copy_session(session, out)
    for kind in (RAW, DERIVED):
        rewrite(file_of(copy, kind), attachments={CONFIG_ATTACHMENT: text.encode()})
    return copy


def differing(score: Score) -> list[str]:
    """The keys that differ."""
    return [one.name for one in score.findings if one.about == CONFIGURATION and one.result is Result.FAILS]


def test_the_truth_has_the_configuration_that_was_played(recorded: Path) -> None:
    attachments = McapFile(file_of(recorded, TRUTH)).head().attachments
    assert attachments[CONFIG_ATTACHMENT].decode() == CONFIG


UNSTATED = ("nav.unstated_sd.inertial", "nav.unstated_sd.satellites")


@pytest.mark.parametrize(
    ("old", "new", "keys"),
    [
        (CONFIG[CONFIG.index("[nav]") :], "", ["nav.altimeters", "nav.position"]),
        ('altimeters = ["altimeter"]', "altimeters = []", ["nav.altimeters"]),
        ('position = ["gnss", "spare"]', 'position = ["spare", "gnss"]', ["nav.position"]),
        ("rate_hz = 10\n", "", ["device.altimeter.rate_hz"]),
        ("max_age_ms = 500\n", "max_age_ms = 5000\n", ["device.altimeter.max_age_ms"]),
        ("range_m = [0.5, 762]", "range_m = [0.5, 100]", ["device.altimeter.altimeter.range_m"]),
        ('checksum = "xor"', 'checksum = "none"', ["device.altimeter.options.checksum"]),
        (SPARE, "", ["device.spare", "nav.position"]),
        ('name = "spare"', 'name = "other"', ["device.other", "device.spare", "nav.position"]),
        ('"spare_line"', '"spare_wire"', ["device.spare.link", "link.spare_line", "link.spare_wire"]),
    ],
)
def test_another_configuration_is_a_miss_and_its_keys_are_named(
    recorded: Path, tmp_path: Path, old: str, new: str, keys: list[str]
) -> None:
    text = CONFIG.replace(old, new)
    if '"other"' in new or old == SPARE:  # the roles go with the device
        text = text.replace('position = ["gnss", "spare"]', 'position = ["gnss"]')
    score = score_of(short_scenario(CUT), recorded_with(recorded, tmp_path, text))
    assert differing(score) == keys
    assert score.outcome is FlightOutcome.FAILED
    assert f"{keys[0]}: " in as_text(score)[-1]
    assert [row.result for row in score.rows] == [Result.FOUND]  # by what was played, whatever is recorded


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('port = "/dev/unused"', 'port = "/dev/ttyUSB3"\nbaud = 9600'),
        ('name = "short"', 'name = "long"'),
        ("[nav]", "[display]\nport = 0\n\n[bus]\nport = 7447\n\n[nav]"),
        ("rate_hz = 10\n", "rate_hz = 10.0\nlatency_ms = 0.0\n"),
    ],
)
def test_ports_names_and_pages_may_differ(recorded: Path, tmp_path: Path, old: str, new: str) -> None:
    assert CONFIG.replace(old, new) != CONFIG
    score = score_of(short_scenario(CUT), recorded_with(recorded, tmp_path, CONFIG.replace(old, new)))
    assert differing(score) == []
    assert score.outcome is FlightOutcome.HOLDS


def test_a_configuration_that_is_wrong_is_a_miss(recorded: Path, tmp_path: Path) -> None:
    score = score_of(short_scenario(CUT), recorded_with(recorded, tmp_path, CONFIG.replace("rate_hz", "rate")))
    assert score.outcome is FlightOutcome.FAILED


@pytest.mark.parametrize(
    ("old", "new", "keys"),
    [
        ("[nav.approach]\n", None, ["nav.approach", *UNSTATED]),
        ("terrain = { scene", "# terrain = { scene", ["nav.terrain"]),
        ("[nav.filter]", None, ["nav.alert_limits.altitude_m", "nav.approach", "nav.filter", *UNSTATED]),
        ("alert_v_m = 50.0", "alert_v_m = 500.0", ["nav.approach.alert_v_m"]),
        ('"demo_country"', '"demo"', ["nav.terrain.scene"]),
    ],
)
def test_tables_of_navigation_count(old: str, new: str | None, keys: list[str]) -> None:
    """new None: everything from there on is taken away."""
    demo = ROOT / "configs" / "demo.toml"
    text = demo.read_text()
    other = text[: text.index(old)] if new is None else text.replace(old, new)
    assert other != text
    config = configuration.parse(configuration.parse_toml(other, "other"), other, demo)
    assert [key for key, *_ in differences(other_setup(str(demo)), config, read_texts(config))] == keys


def test_of_a_file_the_content_counts_and_not_where_it_lies(tmp_path: Path) -> None:
    demo = ROOT / "configs" / "demo.toml"
    setup = other_setup(str(demo))
    config = configuration.parse(
        configuration.parse_toml(setup.config.text, "other"), setup.config.text, tmp_path / "x"
    )
    texts = dict(setup.texts)
    assert not list(differences(setup, config, texts))
    texts["nav.approach.profile"] += "\n"
    assert [key for key, *_ in differences(setup, config, texts)] == ["nav.approach.profile"]


def test_the_configuration_that_the_user_gives_is_not_compared(recorded: Path, tmp_path: Path) -> None:
    (tmp_path / "given.toml").write_text(CONFIG)
    session = recorded_with(recorded, tmp_path, CONFIG.replace("rate_hz = 10\n", ""))
    score = score_of(short_scenario(CUT), session, other_setup(str(tmp_path / "given.toml")))
    assert score.outcome is FlightOutcome.HOLDS
    assert "--config" in as_text(score)[-1]


# ------------------------------------------------------------------------------------------------ older truth files


def test_an_older_truth_is_scored_by_the_configuration_of_the_scenario(recorded: Path, tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(CONFIG)
    scenario = short_scenario(CUT, config=str(tmp_path / "own.toml"))
    session = recorded_with(recorded, tmp_path, CONFIG)
    rewrite(file_of(session, TRUTH), attachments={CONFIG_ATTACHMENT: None})
    assert score_of(scenario, session).outcome is FlightOutcome.HOLDS
    for kind in (RAW, DERIVED):
        rewrite(file_of(session, kind), attachments={CONFIG_ATTACHMENT: NO_ALTIMETERS.encode()})
    score = score_of(scenario, session)
    assert differing(score) == ["nav.altimeters"]
    with pytest.raises(MissingError):
        score_of(short_scenario(CUT), session)


# -------------------------------------------------------------------------------------------------- roles that vanish


def own(tmp_path: Path, text: str, faults: tuple[dict[str, object], ...]) -> Scenario:
    """A scenario that names a configuration with this text."""
    (tmp_path / "own.toml").write_text(text)
    return short_scenario(faults, config=str(tmp_path / "own.toml"))


@pytest.mark.parametrize(
    ("faults", "old", "new", "flag"),
    [
        (CUT, 'altimeters = ["altimeter"]', "altimeters = []", "/nav/height_above_ground/altimeter stale"),
        (DOUBLED, "rate_hz = 5\n", "", "/fti/health/devices/spare wrong rate"),
        (CUT, "max_age_ms = 500\n", "max_age_ms = 5000\n", "/nav/height_above_ground/altimeter stale"),
    ],
)
def test_a_required_flag_that_vanishes_is_a_miss_where_the_scenario_needs_it(
    tmp_path: Path, faults: tuple[dict[str, object], ...], old: str, new: str, flag: str
) -> None:
    played = CONFIG.replace(old, new)
    scenario = own(tmp_path, CONFIG, faults)
    session = session_of(scenario, tmp_path, played)
    score = score_of(scenario, session)
    assert differing(score) == []
    assert (flag, Result.NOT_CONFIGURED) in [(row.flag, row.result) for row in score.rows]
    assert score.outcome is FlightOutcome.FAILED
    assert score_of(own(tmp_path, played, faults), session).outcome is FlightOutcome.HOLDS


def test_a_required_flag_that_vanishes_and_was_not_flown_is_no_miss(tmp_path: Path) -> None:
    late = ({**CUT[0], "from_s": 60.0, "to_s": 63.0},)
    scenario = own(tmp_path, CONFIG, late)
    assert score_of(scenario, session_of(scenario, tmp_path, NO_ALTIMETERS)).outcome is FlightOutcome.HOLDS
