"""23 devices on 23 links past the recorder: everything that was sent is there, and every rate is judged.

Whether the rates were held on this machine is printed; ``benchmarks/timing.py`` judges that, where nothing else runs.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.parts.fleet import DEVICES, write_config
from benchmarks.timing import play
from fti import config as configuration
from fti.logger.reading.recording import Recording
from fti.logger.verify.link_hash import link_hashes

pytestmark = [pytest.mark.e2e, pytest.mark.alone, pytest.mark.timeout(3600)]
QUICK_S, FULL_S = 5.0, 60.0


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    quick = metafunc.config.getoption("--scale") == "quick"
    metafunc.parametrize("factor", [4] if quick else [1, 4])


def test_every_device_is_received_at_a_multiple_of_its_rate(factor: int, tmp_path: Path, scale: int) -> None:
    seconds, config = QUICK_S if scale == 1 else FULL_S, write_config(tmp_path, factor)
    arguments = ("hil", "nominal", "--config", config, "--wait", "--duration", seconds)
    report, session, _ = play(tmp_path, arguments, configuration.load(config).link)
    assert report["devices"].keys() == DEVICES.keys()
    for name, device in report["devices"].items():
        assert device["asked_hz"] == factor * DEVICES[name].rate_hz
        assert device["lateness"]["messages"] == pytest.approx(seconds * device["asked_hz"], rel=0.01, abs=2), name
        assert device["held"] is not any(why.startswith(f"{name}: ") for why in report["not_held"])
    recorded = link_hashes(Recording.open(session))
    for name, link in report["links"].items():
        assert link["dropped_messages"] == 0, name
        if DEVICES[name].kind == "serial":
            assert recorded[name].bytes == link["bytes"], name
        else:  # a slcan adapter has answered commands, too
            assert recorded[name].frames == pytest.approx(link["messages"], abs=60 if name != "ins_fast" else 0), name
    print(json.dumps(report["lateness"]), "not held:", report["not_held"])
