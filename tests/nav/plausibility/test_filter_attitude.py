"""Attitude sources against the attitude of the filter: fed by hand, with angles that the test states."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pytest

from fti.messages.measurements import Attitude, Stamp
from fti.messages.outputs import Event, FilterMode, FilterSolution, SourceValidity
from fti.messages.reasons import Reason
from tests.nav.plausibility.test_attitudes import DEG, HZ, T0, S, monitor

Angles = tuple[float, float, float]
BEGIN = 40.0


def fly(
    sources: Mapping[str, Angles],
    seconds: float,
    *,
    end: float = math.inf,
    tilt_sd: float = 0.05,
    heading_sd: float = 0.3,
    aided: tuple[float, float] = (0.0, math.inf),
) -> tuple[dict[str, list[float]], list[SourceValidity], list[Event]]:
    """Level, to the north; each source adds its roll, pitch, heading [deg] from BEGIN to ``end`` [s].

    aided : from when to when satellites aid the filter [s].  Returns the times at which each source was refused [s],
    the validities and the events.
    """
    of, refused = monitor(tuple(sources)), {name: list[float]() for name in sources}
    validities, events = list[SourceValidity](), list[Event]()
    for k in range(round(seconds * HZ)):
        t, t_ns = k / HZ, T0 + k * S // HZ
        for name, off in sources.items():
            roll, pitch, heading = (angle * DEG if BEGIN <= t < end else 0.0 for angle in off)
            m = Attitude(stamp=Stamp(t_ns), roll=roll, pitch=pitch, heading=heading % (2 * math.pi))
            if not all(each.valid for each in of.check(name, m, t_ns) if isinstance(each, Attitude)):
                refused[name].append(t)
        if k % 5 == 0:
            of.feed_filter(
                FilterSolution(
                    t_ns=t_ns, t_valid_ns=t_ns, valid=True, reasons=(), roll=0.0, pitch=0.0, heading=0.0,
                    mode=FilterMode.AIDED if aided[0] <= t < aided[1] else FilterMode.COASTING,
                    tilt_sd=tilt_sd * DEG, heading_sd=heading_sd * DEG,
                )
            )  # fmt: skip
        for o in of.tick(t_ns):
            if isinstance(o, SourceValidity):
                validities.append(o)
            elif isinstance(o, Event):
                events.append(o)
    return refused, validities, events


@pytest.mark.parametrize("off", [(3.0, 0.0, 0.0), (0.0, -3.0, 0.0), (0.0, 0.0, -8.0)])
def test_an_attitude_beyond_the_limit_is_refused_after_5_s(off: Angles) -> None:
    refused, validities, events = fly({"ins": off, "ahrs": (0.0, 0.0, 0.0)}, 60.0)
    assert BEGIN + 5.0 <= refused["ins"][0] <= BEGIN + 6.0
    assert refused["ins"][-1] > 59.9
    assert refused["ahrs"] == []
    assert {o.source: o for o in validities}["ins"].reasons == (Reason.ATTITUDES_DISAGREE,)
    assert any("from that of the filter" in e.text and e.source == "ins" for e in events)


def test_a_single_source_is_refused_too() -> None:
    refused, _, _ = fly({"ins": (4.0, 0.0, 0.0)}, 60.0)
    assert refused["ins"]


def test_within_the_limit_and_the_sigma_of_the_filter_nothing_is_refused() -> None:
    assert fly({"ins": (1.9, -1.9, 4.5)}, 80.0)[0]["ins"] == []
    assert fly({"ins": (3.0, 0.0, 0.0)}, 80.0, tilt_sd=0.3)[0]["ins"] == []
    assert fly({"ins": (0.0, 0.0, 12.0)}, 80.0, heading_sd=2.0)[0]["ins"] == []


def test_a_filter_that_is_not_certain_or_not_aided_for_30_s_refuses_nothing() -> None:
    assert fly({"ins": (20.0, 0.0, 0.0)}, 80.0, tilt_sd=0.6)[0]["ins"] == []
    assert fly({"ins": (20.0, 0.0, 0.0)}, 80.0, aided=(55.0, math.inf))[0]["ins"] == []
    assert fly({"ins": (20.0, 0.0, 0.0)}, 80.0, aided=(0.0, BEGIN))[0]["ins"] == []


def test_two_sources_that_contradict_the_filter_alike_outvote_it() -> None:
    refused, _, _ = fly({"ins": (5.0, 0.0, 0.0), "ahrs": (5.2, 0.0, 0.0)}, 80.0)
    assert refused == {"ins": [], "ahrs": []}


def test_two_that_contradict_the_filter_and_each_other_are_both_refused() -> None:
    refused, _, _ = fly({"ins": (8.0, 0.0, 0.0), "ahrs": (-8.0, 0.0, 0.0)}, 80.0)
    assert refused["ins"]
    assert refused["ahrs"]


def test_it_is_valid_again_after_30_s_of_agreement_and_not_because_the_filter_is_gone() -> None:
    refused, _, _ = fly({"ins": (5.0, 0.0, 0.0)}, 100.0, end=60.0)
    assert 89.0 <= refused["ins"][-1] <= 91.5
    refused, _, _ = fly({"ins": (5.0, 0.0, 0.0)}, 120.0, aided=(0.0, 50.0))
    assert refused["ins"][-1] > 119.9
