"""Every command of the README and the documentation is run, and what stands elsewhere exists.

The commands run in a folder with copies of the examples, as a user's: those of the laboratory against the emulator,
those of the flight against a running ``fti demo``, those after the flight on its session.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shlex
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from tests.documented_commands import mentions, page_targets, printed_commands, unknown_words
from tests.e2e.harness import END_S, FTI, START_S, with_free_ports
from tests.helpers import ROOT, until
from tests.terrain.elevation_files import write_ground, write_hgt

#: Pages whose commands another test executes, all of them in their order.
EXECUTED_PAGES = {
    "docs/first-steps.md": "tests/test_first_steps.py",
    "docs/add-a-sensor.md": "tests/test_add_a_sensor.py",
    "docs/analysis.md": "tests/test_analysis_page.py",
}
#: Commands that another test runs, because they take minutes or need another place: its file, and what is in it.
ELSEWHERE = {
    r"fti demo": ("tests/e2e/test_demo.py", 'fti("demo", '),
    r"fti examples copy bench /etc/fti": ("tests/packaging/test_debian.py", '"fti", "examples", "copy", "bench", '),
    r"fti (hil|run|score) \S*gauntlet_serial.*": ("tests/e2e/conftest.py", '"gauntlet_serial": '),
    r"fti score all --fly /tmp/flown --junit all.xml": (
        "tests/cli/test_score.py",
        '"--junit", str(tmp_path / "all.xml")',
    ),
    r"fti score source_faults/latency --fly /tmp/flown": ("tests/post/score/test_source_fault_scenarios.py", "latency"),
    r"fti reprocess .* --compare-terrain-methods": (
        "tests/e2e/test_accelerated_scores.py",
        '"--compare-terrain-methods"',
    ),
    r"fti reference make .*": ("tests/cli/test_reference.py", '"make"'),
    r"fti reference fit .*": ("tests/cli/test_reference_fit.py", '"fit"'),
    r"fti terrain judge .*": ("tests/cli/test_terrain_judge.py", '"terrain", "judge", session('),
    r"fti ground .*": ("tests/e2e/test_ground_station.py", '"ground", "--connect"'),
    r"fti watch --router .*": ("tests/e2e/test_ground_station.py", '"watch", "--router"'),
    r"fti terrain strips .*": ("tests/post/test_laser_strips.py", 'main(["terrain", "strips"'),
    r"fti publish .*": ("tests/e2e/test_publish_session.py", 'fti("publish", '),
    r"fti study trajectory": ("tests/study/test_trajectory.py", 'main(["study", "trajectory"'),
    r"fti study slant-range .*": ("tests/study/test_slant_range.py", "slant_range.study("),
    r"fti study validity": ("tests/study/test_validity.py", "validity.study("),
    r"fti study compensation": ("tests/study/test_compensation.py", "compensation.study("),
    r"fti study faults --runs 1": ("tests/study/test_faults_study.py", 'main(["study", "faults"'),
    r"fti study bound": ("tests/study/test_bound.py", "bound.study("),
    r"fti study clearance": ("tests/study/test_clearance.py", "clearance.study("),
    r"fti study ranging": ("tests/study/test_studies.py", 'main(["study", "ranging"'),
}


@dataclass(frozen=True)
class Run:
    """How a command runs here.

    more : arguments that are added;  words : replacements of documented words
    prints : pattern of its output;  codes : exit codes that are right
    """

    command: str
    prints: str
    more: str = ""
    codes: tuple[int, ...] = (0,)
    words: dict[str, str] = field(default_factory=dict)


DEMO = {"configs/bench.toml": "configs/demo.toml"}
WITHOUT_DAEMON = [
    Run("fti ports", r"127\.0\.0\.1 +udp"),
    Run("fti topics", r"/nav/glide_slope"),
    Run("fti check configs/bench.toml", r"configs/bench\.toml: good"),
    Run("fti check /etc/fti/fti.toml", r"configs/bench\.toml: good", words={"/etc/fti/fti.toml": "configs/bench.toml"}),
    Run("fti check configs/bench.toml --live", r"no such port", codes=(1,)),
    Run("fti run configs/bench.toml", r"recorded \S+/recorded/bench_", more="--duration 2 --out recorded"),
    Run("fti check silence", r"/nav/glide_slope"),
    Run("fti hil --list", r"silence +All sensors silent"),
    Run("fti hil --faults", r"to_s +\[s\]"),
    Run("fti hil jsbsim_pattern --plot flight.png", r"flies route pattern"),
    Run("fti check my_scenario.toml --config my_aircraft.toml", r"expected flags"),
    Run("fti score silence --fly /tmp/flown", r"holds: 19 of 19 expected flags"),
    Run("fti terrain info dsm_1m.tif N47E011.hgt --vertical dsm_1m.tif=egm96", r"EGM96"),
    Run("fti terrain info N47E011.hgt dsm_2m.tif --vertical dsm_2m.tif=egm96", r"EGM96"),
    Run("fti terrain plot N47E011.hgt --at 47.9,11.8 --radius 5000 --out map.png", r"map\.png"),
    Run(
        "fti terrain plot N47E011.hgt dsm_2m.tif --vertical dsm_2m.tif=egm96 --at 47.9,11.8 --radius 5000"
        " --profile 47.88,11.75/47.92,11.85 --out map.png",
        r"profile\.png",
        words={"map.png": "profile.png"},
    ),
    Run("fti terrain spectrum N47E011.hgt --at 47.9,11.8 --radius 5000 --speed 60", r"heights +waves of \d+ m"),
    Run(
        "fti terrain spectrum N47E011.hgt --at 47.9,11.8 --radius 5000 --speed 60 --out spectrum.png", r"spectrum\.png"
    ),
    Run("fti hil template --out mine.toml", r"mine\.toml"),
    Run("fti study --list", r"slant_range +Slant range"),
    Run("fti study trajectory --help", r"Default: \d+ runs, seed \d+"),
    Run("fti examples", r"research_aircraft"),
    Run("fti examples copy all configs", r"copies/demo\.toml", words={"configs": "copies"}),
    Run("fti examples copy layouts .", r"layouts/foxglove\.json"),
    Run("fti examples copy research_aircraft mine", r"mine/research_aircraft\.toml"),
]
#: While the emulator has opened its ports and no daemon runs.
WITH_PORTS = [
    Run("fti listen /dev/ttyUSB0 --baud 57600", r"freeflight_ra4500", "--duration 3", words={"/dev/ttyUSB0": "RADALT"}),
    Run("fti new aircraft.toml", r"aircraft\.toml: \d devices", more="--links /tmp/links"),
]
#: With ``fti run configs/demo.toml --links /tmp/links --origin hil``.
WITH_BREAKERS = [
    Run("fti send pdu trip breaker=altimeter", r"acknowledged after \d+ ms: altimeter: tripped"),
    Run("fti send pdu reset breaker=altimeter", r"acknowledged after \d+ ms: altimeter: starting"),
]
#: While ``fti demo`` flies.
LIVE = [
    Run("fti preflight configs/bench.toml", r"GO +position +from ins", codes=(0, 1), words=DEMO),
    Run("fti page", r"http://127\.0\.0\.1:\d+/#key=", more="--print"),
    Run("fti page --print", r"http://127\.0\.0\.1:\d+/#key="),
    Run("fti watch", r"radalt_line +good", more="--once"),
    Run('fti mark "begin of approach 3"', r"marked at "),
    Run('fti mark --trigger "flutter"', r"triggered at "),
    Run("fti acknowledge", r"\d+ alarms? acknowledged|no alarm"),
    Run("fti readmit gnss", r"gnss: readmitted"),
    Run("fti send --list", r"pdu +power_unit +pdu_line may transmit"),
]
AFTER = [
    Run("fti info SESSION", r"approaches +1: "),
    Run("fti info -v SESSION --plot activity.html", r"begin of approach 3"),
    Run("fti verify SESSION", r"all holds: \d+ files"),
    Run("fti sync SESSION --plot clocks.html", r"FTI against GNSS"),
    Run("fti recover SESSION", r"nothing is missing"),
    Run("fti recover --in-place SESSION", r"is finished"),
    Run("fti export SESSION --out tables --degrees", r"tables/altimeter_radio_height\.csv +\d+ rows"),
    Run("fti reprocess SESSION --out again", r"again/demo_"),
    # longer than 80 s on a busy computer: then there is an estimate
    Run("fti latency SESSION", r"altimeter: (cannot be estimated: needs 80 s|[+-]\d+ ms)"),
    # a busy computer makes gaps, which the score reports: what it must find is tested elsewhere
    Run("fti score silence SESSION --plot score.png", r"\d+ of 19 expected flags found in time", codes=(0, 1)),
    Run(
        "fti score silence obstacle data/demo_*", r"obstacle: no session", codes=(2,), words={"data/demo_*": "SESSION"}
    ),
    Run("fti pack SESSION", r"files rewritten"),
]
RECORDED = "data/demo_20260101T120000Z_0"
AGAIN = [
    Run("fti compare SESSION AGAIN", r"pdu_line .* EQUAL"),
    Run(
        f"fti compare {RECORDED} /tmp/again/demo_*",
        r"pdu_line .* EQUAL",
        words={RECORDED: "SESSION", "/tmp/again/demo_*": "AGAIN"},
    ),
]
#: The sensors of the scenario are silent until 35 s; its flags must then end.
SILENT_UNTIL_S = 42.0
PREFLIGHT = "fti preflight configs/demo.toml"
#: Commands that run until Ctrl-C, beside others.
BACKGROUND = [
    "fti hil nominal --links /tmp/links",
    "fti run configs/demo.toml --links /tmp/links --origin hil",
    "fti replay SESSION --links /tmp/links",
    f"fti replay {RECORDED} --links /tmp/links",
    "fti run configs/demo.toml --links /tmp/links --origin replay",
    "fti run configs/demo.toml --links /tmp/links --out /tmp/again --origin replay",
]


def test_every_command_in_a_block_of_code_is_run() -> None:
    here = {run.command for runs in (WITHOUT_DAEMON, WITH_PORTS, WITH_BREAKERS, LIVE, AFTER, AGAIN) for run in runs}
    printed = {each.command for each in printed_commands() if each.page not in EXECUTED_PAGES}
    elsewhere = {command for command in printed if any(re.fullmatch(known, command) for known in ELSEWHERE)}
    assert printed - elsewhere == here | {*BACKGROUND}


def test_what_another_test_runs_is_in_that_test() -> None:
    for file, text in ELSEWHERE.values():
        assert text in (ROOT / file).read_text(encoding="utf-8"), (file, text)
    for page, file in EXECUTED_PAGES.items():
        assert Path(page).name in (ROOT / file).read_text(encoding="utf-8")


def test_every_mentioned_command_and_option_exists() -> None:
    every = [*mentions()]
    assert len(every) > 300
    assert [(each, unknown) for each in every if (unknown := unknown_words(each.command))] == []


def test_every_mentioned_target_of_make_exists() -> None:
    targets = re.search(r"^\.PHONY: (.+)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert targets and page_targets() <= {*targets[1].split()}


# ------------------------------------------------------------------------------------------------------------ runs


@dataclass(slots=True)
class UserFolder:
    """The folder of a user, and the words of the pages that stand for something of it."""

    folder: Path
    words: dict[str, str]
    _most_flown_s: float = 0.0

    @property
    def environment(self) -> dict[str, str]:
        return {**os.environ, "XDG_RUNTIME_DIR": str(self.folder), "PYTHONPATH": str(ROOT)}

    def arguments(self, command: str, words: dict[str, str]) -> list[str]:
        """The command with the words of this folder."""
        for documented, here in (*words.items(), *self.words.items()):
            command = command.replace(documented, here)
        return [*FTI, *shlex.split(command)[1:]]

    def output(self, command: str, words: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.arguments(command, words or {}),
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=END_S,
            check=False,
        )

    def has_flown(self, seconds: float) -> bool:
        """Whether the flight is later than that, or the next one has begun."""
        state = json.loads(self.output("fti watch --once --json").stdout)["hil"]
        self._most_flown_s = max(self._most_flown_s, state["flight_s"] or 0.0)
        return self._most_flown_s > seconds

    def run(self, run: Run) -> None:
        done = self.output(f"{run.command} {run.more}", run.words)
        assert done.returncode in run.codes and re.search(run.prints, done.stdout), f"{run.command}:\n{done.stdout}"

    @contextlib.contextmanager
    def background(self, command: str, more: str, ready: str) -> Iterator[subprocess.Popen[str]]:
        """A command that runs until the block ends, once it has printed a text; then Ctrl-C ends it."""
        printed = self.folder / f"{command.split()[1]}.txt"
        with (
            printed.open("w") as file,
            subprocess.Popen(
                self.arguments(f"{command} {more}", {}),
                cwd=self.folder,
                env=self.environment,
                stdout=file,
                stderr=subprocess.STDOUT,
                text=True,
            ) as process,
        ):
            try:
                until(
                    lambda: ready in printed.read_text() or process.poll() is not None, START_S, f"{ready} of {command}"
                )
                assert process.poll() is None, printed.read_text()
                yield process
            finally:
                if process.poll() is None:
                    process.send_signal(signal.SIGINT)
            assert process.wait(END_S) in (0, 130), printed.read_text()

    def session(self, folder: str) -> str:
        (session,) = (self.folder / folder).glob("demo_*")
        return str(session.relative_to(self.folder))


@pytest.fixture(scope="module")
def user(tmp_path_factory: pytest.TempPathFactory) -> UserFolder:
    """A folder with the examples, on ports that nobody else uses, and elevation files."""
    folder = tmp_path_factory.mktemp("user")
    user = UserFolder(folder, {"/tmp/": f"{folder}/"})
    user.run(Run("fti examples copy all configs", r"configs/demo\.toml"))
    demo = folder / "configs" / "demo.toml"
    demo.write_text(with_free_ports(demo.read_text()) + "\n[snapshot]\nbefore_s = 10\nafter_s = 1\n")
    (folder / "my_aircraft.toml").symlink_to(demo)
    (folder / "my_scenario.toml").symlink_to(folder / "configs" / "scenarios" / "silence.toml")
    write_hgt(folder, lambda lat, lon: 500.0 + 50.0 * np.sin(400.0 * lat) + 500.0 * (lon - 11.5))
    for name, step in (("dsm_1m.tif", 1.0), ("dsm_2m.tif", 2.0)):
        write_ground(folder / name, lambda lat, lon: 600.0 + 500.0 * (lat - 47.9), "EPSG:25832", 200, step)
    return user


@pytest.mark.e2e
@pytest.mark.timeout(900)
@pytest.mark.parametrize("run", WITHOUT_DAEMON, ids=lambda run: run.command)
def test_a_command_without_a_daemon(user: UserFolder, run: Run) -> None:
    user.run(run)


@pytest.mark.e2e
@pytest.mark.timeout(900)
def test_the_laboratory_and_its_recording_again(user: UserFolder) -> None:
    hil, run, replay, _, again, _ = BACKGROUND
    with user.background(hil, "--config configs/demo.toml", "ready"):
        user.words["RADALT"] = str(user.folder / "links" / "radalt_line")
        for each in WITH_PORTS:
            user.run(each)
        with user.background(run, "--out lab", "display at"):
            # navigation decodes the answers of the power unit
            until(lambda: "GO     link pdu_line" in user.output(PREFLIGHT).stdout, START_S, "the power unit")
            until(lambda: "GO     navigation" in user.output(PREFLIGHT).stdout, START_S, "navigation")
            for each in WITH_BREAKERS:
                user.run(each)
    user.words["SESSION"] = user.session("lab")
    ready = "radalt_line"
    with user.background(replay, "", ready) as replayed, user.background(again, "--out replayed", "recording to"):
        replayed.wait(END_S)
    user.words["AGAIN"] = user.session("replayed")
    for each in AGAIN:
        user.run(each)


@pytest.mark.e2e
@pytest.mark.timeout(900)
def test_the_demonstration_live_and_its_session(user: UserFolder) -> None:
    options = "--headless --scenario configs/scenarios/silence.toml --out data"
    with user.background("fti demo", options, "flying"):
        until(lambda: "GO     position" in user.output(PREFLIGHT).stdout, START_S, "a position")
        for each in LIVE:
            user.run(each)
        until(lambda: user.has_flown(SILENT_UNTIL_S), START_S, "the end of the fault")
    user.words["SESSION"] = user.session("data")
    for each in AFTER:
        user.run(each)
