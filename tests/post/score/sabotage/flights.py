"""The sessions that are attacked: accelerated flights of shipped scenarios, and a short one of three devices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fti.hil import scenario as scenarios
from fti.hil.environment import Environment
from fti.hil.scenario import Scenario
from fti.hil.tables.flights import ApproachFlight
from fti.post import offline_run
from tests.hil.worlds import flat_terrain, path
from tests.post.score.sabotage.configurations import as_toml
from tests.post.score.sabotage.falsification import Sample
from tests.post.score.sabotage.score_run import run_score
from tests.post.score.sabotage.session_copy import Session
from tests.post.score.short_flight import CONFIG, DURATION_S, FAULTS


def find_session(folder: Path) -> Path:
    """The only session folder below a folder."""
    (session,) = [place for place in folder.iterdir() if place.is_dir() and list(place.glob("*_derived_*.mcap"))]
    return session


def fly(scenario: Scenario, folder: Path, duration_s: float | None = None) -> Path:
    """Fly a scenario, faster than time; returns the session folder."""
    return offline_run.fly(scenarios.load_config(scenario), scenario, folder, until_s=duration_s)


def sample_of(scenario: str, session: Path, others: dict[str, Path] | None = None, truth: Path | None = None) -> Sample:
    """A session for falsification; the original is scored first."""
    content = Session.read(session, truth)
    return Sample(scenario, content, run_score(scenario, session, truth), others or {})


def shipped_sample(name: str, folder: Path, duration_s: float | None = None, *, others: bool = True) -> Sample:
    """A shipped scenario; another one and another seed of the same configuration beside it."""
    scenario = scenarios.load(scenarios.find(name))
    session = fly(scenario, folder / name, duration_s)
    other_sessions: dict[str, Path] = {}
    if others:
        seed = scenario.model_copy(update={"seed": scenario.seed + 100})
        other_sessions["other seed"] = fly(seed, folder / f"{name}_seed", duration_s)
        without = scenario.model_copy(update={"fault": (), "title": "another", "flight": _other_flight(scenario)})
        other_sessions["other scenario"] = fly(without, folder / f"{name}_other", duration_s)
    return sample_of(name, session, other_sessions)


def _other_flight(scenario: Scenario) -> object:
    """An approach that begins nearer; as long."""
    return ApproachFlight(start_m=3500.0) if isinstance(scenario.flight, ApproachFlight) else ApproachFlight()


# ------------------------------------------------------------------------------------------------- the short flight

#: An attitude beside the three devices, so that heights and positions are valid.
ATTITUDE = """
[[link]]
name = "ahrs_line"
kind = "serial"
port = "/dev/unused"

[[device]]
name = "ahrs"
link = "ahrs_line"
driver = "arinc429"
rate_hz = 25
max_age_ms = 500
options = { set = "ahrs" }

[nav]
attitude = ["ahrs"]
"""


def short_file(folder: Path, seed: int = 1, *, faults: bool = True) -> Path:
    """The scenario of the short flight as a file, with its configuration beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "short.toml").write_text(CONFIG.replace("[nav]", ATTITUDE))
    table = {
        "title": "test",
        "description": "",
        "config": "short.toml",
        "seed": seed,
        "flight": {"kind": "approach", "duration_s": DURATION_S},
        "fault": [_listed(fault) for fault in FAULTS] if faults else [],
    }
    file = folder / "scenario.toml"
    file.write_text("\n".join(f"{key} = {as_toml(value)}" for key, value in table.items()))
    return file


def _listed(fault: dict[str, object]) -> dict[str, object]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in fault.items()}


def fly_short(file: Path) -> Path:
    """Fly the short flight of a scenario file; returns the session folder."""
    scenario = scenarios.load(file)
    world = Environment(scenario, path(), flat_terrain(), undulation=47.0)
    return offline_run.fly(scenarios.load_config(scenario), scenario, file.parent / "out", world=world)


def short_sample(folder: Path) -> Sample:
    """The short flight; another seed and the same without faults beside it."""
    file = short_file(folder / "short")
    others = {
        "other seed": fly_short(short_file(folder / "seed", 2)),
        "other scenario": fly_short(short_file(folder / "nominal", faults=False)),
    }
    return replace(sample_of(str(file), fly_short(file), others), title="short")
