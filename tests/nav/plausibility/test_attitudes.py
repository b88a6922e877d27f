"""Attitude sources against each other, and headings against the track."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from fti.config import parse
from fti.messages.measurements import Attitude, Measurement, Position, Stamp, Velocity
from fti.messages.outputs import Event, SourceValidity
from fti.messages.reasons import Reason
from fti.nav.plausibility.monitor import PlausibilityMonitor

S = 1_000_000_000
T0 = 1000 * S
DEG = math.radians(1.0)
HZ = 25


def monitor(sources: tuple[str, ...]) -> PlausibilityMonitor:
    device = {"link": "l", "driver": "d"}
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": name, **device} for name in sources],
        "nav": {"attitude": list(sources), "position": [sources[0]]},
    }
    return PlausibilityMonitor(parse(table, "", Path("t.toml")))


def fly(
    sources: dict[str, tuple[float, float, float]],
    seconds: float,
    begin: float = 0.0,
    speed: float = 150.0,
    end: float = 1e9,
) -> tuple[dict[str, list[tuple[float, bool]]], list[SourceValidity], list[Event]]:
    """A flight north with a slow roll; each source adds its roll, pitch, heading [deg] from begin to end [s].

    Returns whether each attitude and its heading were admitted, the validities and the events.
    """
    of, admitted = monitor(tuple(sources)), {name: list[tuple[float, bool]]() for name in sources}
    validities, events = list[SourceValidity](), list[Event]()
    for k in range(round(seconds * HZ)):
        t = k / HZ
        stamp = Stamp(T0 + k * S // HZ)
        first = next(iter(sources))
        lat = 0.8 + speed * t / 6.38e6
        place = Position(stamp=stamp, lat=lat, lon=0.2, alt=900.0, horizontal_sd=2.0, vertical_sd=3.0)
        messages: list[tuple[str, Measurement]] = [
            (first, Velocity(stamp=stamp, north=speed, east=0.0, down=0.0)), (first, place)
        ]  # fmt: skip
        for name, off in sources.items():
            roll, pitch, heading = (o * DEG if begin <= t < end else 0.0 for o in off)
            roll += 4.0 * DEG * math.sin(0.4 * t)
            messages.append((name, Attitude(stamp=stamp, roll=roll, pitch=pitch, heading=heading % (2 * math.pi))))
        for name, m in messages:
            out = of.check(name, m, stamp.t_rx_ns)
            if isinstance(m, Attitude):
                admitted[name].append((t, all(isinstance(each, Attitude) and each.valid for each in out)))
        for o in of.tick(stamp.t_rx_ns):
            if isinstance(o, SourceValidity):
                validities.append(o)
            elif isinstance(o, Event):
                events.append(o)
    return admitted, validities, events


@pytest.mark.parametrize("off", [(6.0, 0.0, 0.0), (0.0, -6.0, 0.0), (0.0, 0.0, 25.0)])
def test_of_three_the_one_that_contradicts_two_is_refused_within_3_s(off: tuple[float, float, float]) -> None:
    admitted, validities, events = fly(
        {"ins": (0, 0, 0), "ahrs": off, "autopilot": (0, 0, 0)}, 30.0, begin=10.0, end=1e9
    )
    assert all(valid for t, valid in admitted["ahrs"] if t < 10.0)
    assert not any(valid for t, valid in admitted["ahrs"] if t > 13.0)
    assert all(valid for name in ("ins", "autopilot") for _, valid in admitted[name])
    last = {o.source: o for o in validities}
    assert last["ahrs"].reasons == (Reason.ATTITUDES_DISAGREE,)
    assert not last["ahrs"].attitude_valid
    assert any(e.source == "ahrs" and "attitude refused: attitudes_disagree" in e.text for e in events)


def test_it_comes_back_30_s_after_it_agrees_again() -> None:
    sources = {"ins": (0.0, 0.0, 0.0), "ahrs": (6.0, 0.0, 0.0), "autopilot": (0.0, 0.0, 0.0)}
    admitted, _, _ = fly(sources, 60.0, begin=10.0, end=20.0)
    assert not any(valid for t, valid in admitted["ahrs"] if 13.0 < t < 50.0)
    assert all(valid for t, valid in admitted["ahrs"] if t > 55.0)


def test_two_that_disagree_are_both_kept() -> None:
    admitted, validities, events = fly({"ins": (0, 0, 0), "ahrs": (6.0, 0.0, 0.0)}, 30.0, begin=10.0)
    assert all(valid for name in admitted for _, valid in admitted[name])
    assert [e.text for e in events if "disagree" in e.text] == [
        "attitudes disagree: roll of ahrs and ins differ by +6.0 deg"
    ]
    assert all(
        Reason.ATTITUDES_DISAGREE in o.unchecked and o.valid and not o.reasons
        for o in validities
        if o.t_ns > T0 + 14 * S
    )


def test_what_is_within_sigmas_and_limits_is_no_dispute() -> None:
    _, _, events = fly({"ins": (0, 0, 0), "ahrs": (1.5, -1.5, 4.0), "autopilot": (0.5, 0.5, -3.0)}, 60.0)
    assert [e for e in events if "disagree" in e.text] == []


def test_a_heading_that_no_wind_makes_is_refused_alone() -> None:
    admitted, validities, events = fly({"ins": (0.0, 0.0, 60.0)}, 30.0, begin=10.0)
    assert all(valid for t, valid in admitted["ins"] if t < 19.0)
    assert not any(valid for t, valid in admitted["ins"] if t > 21.0)
    assert validities[-1].heading_valid is False
    assert validities[-1].attitude_valid is True
    assert any("heading refused: heading_track: +60 deg from the track at 150 m/s" in e.text for e in events)


def test_a_drift_angle_of_a_strong_wind_and_a_slow_flight_are_not_refused() -> None:
    for speed, heading in ((150.0, 15.0), (50.0, 90.0), (0.0, 180.0)):
        _, validities, _ = fly({"ins": (0.0, 0.0, heading)}, 30.0, speed=speed)
        assert validities[-1].heading_valid is not False


def test_a_single_source_of_position_is_valid_and_unchecked() -> None:
    _, validities, _ = fly({"ins": (0, 0, 0)}, 5.0)
    assert (validities[-1].valid, validities[-1].reasons, validities[-1].unchecked) == (
        True,
        (),
        (Reason.NOTHING_TO_COMPARE,),
    )
