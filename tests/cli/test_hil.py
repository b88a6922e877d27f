"""``fti hil`` and ``fti replay`` as a user calls them."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.e2e.harness import FTI, fti, with_free_ports
from tests.helpers import ROOT

END_S = 60.0


def demo_config(tmp_path: Path) -> Path:
    file = tmp_path / "demo.toml"
    file.write_text(with_free_ports((ROOT / "configs" / "demo.toml").read_text()).partition("[nav.approach]")[0])
    return file


@contextmanager
def command(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen([*FTI, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def test_scenarios_are_listed_name_first() -> None:
    done = fti("hil", "--list")
    assert done.returncode == 0
    names = [line.split()[0] for line in done.stdout.splitlines()]
    assert names == sorted(file.stem for file in (ROOT / "configs" / "scenarios").glob("*.toml"))
    assert {"nominal", "obstacle", "silence", "table"} <= set(names)


def test_a_flight_says_ready_flies_and_reports(tmp_path: Path) -> None:
    truth = tmp_path / "out" / "truth.mcap"
    done = fti(
        *("hil", "nominal", "--duration", "0.5", "--config", str(demo_config(tmp_path))),
        *("--links", str(tmp_path / "links"), "--truth", str(truth)),
    )
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stderr
    assert lines[0] == "ready"
    assert any(line.startswith("ins_eth") and " bytes" in line for line in lines)
    assert lines[-1].startswith("lateness of ")
    assert "sensor ins" in done.stderr
    assert truth.stat().st_size > 0


def test_interrupted_it_ends_with_130_and_takes_its_ports_away(tmp_path: Path) -> None:
    links = tmp_path / "links"
    arguments = ("hil", "nominal", "--wait", "--config", str(demo_config(tmp_path)), "--links", str(links))
    with command(*arguments) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        assert (links / "radalt_line").is_char_device()
        process.send_signal(signal.SIGINT)
        assert process.wait(END_S) == 130
    assert not list(links.iterdir())


def test_mistakes_are_one_sentence(tmp_path: Path) -> None:
    for arguments, said in (
        (["hil", "nomnal"], "fti: no scenario 'nomnal'; there are "),
        (["hil"], "fti: which scenario? There are "),
        (["replay", str(tmp_path / "nothing")], "there is no such session"),
    ):
        done = fti(*arguments)
        assert done.returncode == 2
        assert said in done.stderr
        assert done.stderr.count("\n") == 1
