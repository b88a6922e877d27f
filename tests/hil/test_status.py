"""What the emulator says of itself, and to whom."""

from __future__ import annotations

import json
import os
import queue
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from fti.bus.client import Subscriber
from fti.bus.frame import SOCKET_NAME
from fti.hil.event_loop import realtime_priority
from fti.hil.faults import descriptions
from fti.hil.power import BreakerState
from fti.hil.status import StatusPublisher, describe
from fti.hil.tables.fault_types import Breaker, FaultKind, Fog, GnssOutage, Obstacle
from fti.web.live_state import HIL_FIELDS
from tests.bus.running_hub import RunningHub
from tests.hil.test_emulator import demo_config, make
from tests.run_dirs import running_daemon

FLIGHT_S = 1.0


def test_every_kind_of_fault_has_words() -> None:
    assert set(descriptions.DESCRIPTIONS) == set(FaultKind)


def test_faults_are_described_while_they_act() -> None:
    fog = Fog(kind="fog", devices=("laser",), visibility_m=75.0, from_s=10.0, to_s=20.0)
    jammed = GnssOutage(kind="gnss_outage", from_s=15.0, to_s=30.0)
    tower = Obstacle(kind="obstacle", before_threshold_m=1500.0, height_m=30.0)
    active = {t: list(descriptions.active_faults((fog, jammed, tower), t)) for t in (9.9, 10.0, 19.9, 20.0)}
    assert [[fault["kind"] for fault in active[t]] for t in active] == [
        ["obstacle"],
        ["fog", "obstacle"],
        ["fog", "gnss_outage", "obstacle"],
        ["gnss_outage", "obstacle"],
    ]
    assert active[10.0][0] == {"kind": "fog", "words": "fog, 75 m", "on": ["laser"], "until_s": 20.0}
    assert active[10.0][1] == {
        "kind": "obstacle",
        "words": "obstacle of 30 m, 1500 m before the threshold",
        "on": [],
        "until_s": None,
    }


async def test_devices_links_and_breakers_are_published_before_and_during_the_flight(tmp_path: Path) -> None:
    config = demo_config(tmp_path)
    trip = Breaker(kind="breaker", devices=("gnss",), from_s=0.1, to_s=100.0)
    emulator, _ = make(tmp_path, config, trip, duration_s=FLIGHT_S)
    emulator.prepare()
    before = describe(emulator)
    assert before["flight_s"] is None
    assert before["devices"]["ins"] == {
        "link": "ins_eth",
        "asked_hz": 100.0,
        "messages": 0,
        "breaker": "on",
        "faults": [],
    }
    emulator.start()
    await emulator.run()
    after = json.loads(json.dumps(describe(emulator)))
    assert set(after) >= HIL_FIELDS
    assert after["flight_s"] >= FLIGHT_S * 0.9
    assert after["duration_s"] == FLIGHT_S
    assert after["devices"]["gnss"]["breaker"] == BreakerState.TRIPPED
    assert after["devices"]["gnss"]["faults"] == ["breaker"]
    assert after["devices"]["pdu"]["breaker"] is None
    assert after["devices"]["ins"]["messages"] == pytest.approx(100 * FLIGHT_S, abs=2)
    assert after["devices"]["gnss"]["messages"] <= 6  # the first fix
    assert after["links"]["ins_eth"]["messages"] == after["devices"]["ins"]["messages"]
    assert after["lateness"]["messages"] > 0
    assert [fault["words"] for fault in after["faults"]] == ["breaker tripped"]


def test_it_is_published_to_a_daemon_and_to_the_next_one(tmp_path: Path) -> None:
    emulator, _ = make(tmp_path, demo_config(tmp_path))
    emulator.prepare()
    run_dir = tmp_path / "run"
    run_dir.mkdir()
    policies = set[int]()

    def describe_urgently() -> dict[str, Any]:
        policies.add(os.sched_getscheduler(0))
        return describe(emulator)

    with StatusPublisher(describe_urgently, emulator.backend.clock, "demo", str(run_dir)):
        for _ in range(2):  # the second daemon has another hub
            content = first_word(run_dir)
            assert (content["topic"], content["scenario"], content["late"]) == ("/hil", "test", False)
            assert 0 <= content["age_ms"] < content["max_age_ms"]
    with realtime_priority():
        assert policies == {os.sched_getscheduler(0)}  # as urgent as who sends


def first_word(run_dir: Path) -> dict[str, Any]:
    """The first message to a daemon that starts now."""
    published = queue.SimpleQueue[dict[str, Any]]()

    def hear(topic: str, payload: bytes, sent_ns: int) -> None:
        published.put({"topic": topic} | json.loads(payload))

    with (
        running_daemon(run_dir, "demo"),
        RunningHub(run_dir / SOCKET_NAME) as running,
        closing(Subscriber(running.hub.path, "test", hear)),
    ):
        return published.get(timeout=120)


async def test_without_a_daemon_the_flight_is_the_same(tmp_path: Path) -> None:
    emulator, _ = make(tmp_path, demo_config(tmp_path), duration_s=FLIGHT_S)
    emulator.prepare()
    emulator.start()
    with StatusPublisher(lambda: describe(emulator), emulator.backend.clock, "demo", str(tmp_path / "nobody")):
        report = await emulator.run()
    assert report.links["ins_eth"].messages == pytest.approx(100 * FLIGHT_S, abs=2)
