"""All windows at once: the figures of the monitor, window by window."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from fti.config import Approach
from fti.nav.integrity.batch_monitor import BatchMonitor
from fti.nav.integrity.monitor import ClearanceMonitor, ClearanceSample
from fti.nav.integrity.reference import ApproachReference
from fti.nav.integrity.window import ClearanceSeries

Flight = Callable[..., Iterator[ClearanceSample]]
SETTINGS = Approach(profile="", alert_v_m=12.0)


def track_of(samples: list[ClearanceSample]) -> ClearanceSeries:
    t_ns = np.array([x.t_ns for x in samples])
    names = ("s", "y", "alt", "agl", "roll", "pitch", "climb")
    return ClearanceSeries(t_ns, *(np.array([getattr(x, name) for x in samples]) for name in names))


@pytest.mark.parametrize("speed", [25.0, 60.0])
def test_every_window_has_the_figures_of_the_monitor(
    reference: ApproachReference, flight: Flight, speed: float
) -> None:
    """An obstacle and a wrong place on the way; the flight begins outside the profile and ends behind it."""
    samples = list(
        flight(
            begin=3050.0, end=-80.0, speed=speed,
            surface=lambda s: 40.0 if 1000.0 < s < 1050.0 else 0.0, nav_s=lambda s: s - 15.0,
        )
    )  # fmt: skip
    monitor = ClearanceMonitor(reference, SETTINGS)
    limits = reference.header.limits
    expected = [o for x in samples if (o := monitor.step(x)) is not None and o.t1_ratio is not None]
    window_batch = BatchMonitor(reference, SETTINGS).scan(track_of(samples), 1.0)
    assert window_batch is not None
    assert window_batch.s == pytest.approx([o.s_end for o in expected], abs=1e-9)
    for values, limit, name in ((window_batch.t1, limits.t1, "t1_ratio"), (window_batch.t3, limits.t3, "t3_ratio"),
                                (window_batch.t4, limits.t4, "t4_ratio")):  # fmt: skip
        assert values / limit == pytest.approx([getattr(o, name) for o in expected], rel=1e-9)
    evaluated = np.array([o.t2_ratio is not None for o in expected])
    assert evaluated.any()
    assert (window_batch.t2 / limits.t2)[evaluated] == pytest.approx(
        [o.t2_ratio for o in expected if o.t2_ratio is not None]
    )
    assert window_batch.observability == pytest.approx([o.observability for o in expected])
    assert window_batch.height_error_sd == pytest.approx([o.height_error_sd for o in expected])


@pytest.mark.parametrize(
    ("name", "value"), [("roll", 0.3), ("roll", np.nan), ("s", 2500.0), ("y", -151.0), ("climb", 2.5)]
)
def test_an_approach_with_something_the_matter_is_left_to_the_monitor(
    reference: ApproachReference, flight: Flight, name: str, value: float
) -> None:
    track = track_of(list(flight(begin=2900.0, end=1500.0)))
    getattr(track, name)[300] = value
    assert BatchMonitor(reference, SETTINGS).scan(track, 1.0) is None


def test_an_approach_with_a_gap_is_left_to_the_monitor(reference: ApproachReference, flight: Flight) -> None:
    samples = list(flight(begin=2900.0, end=1500.0))
    assert BatchMonitor(reference, SETTINGS).scan(track_of(samples[:100] + samples[200:]), 1.0) is None
