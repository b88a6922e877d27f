"""Validity: every rule alone, and properties that hold for every sample."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from fti.config import Altimeter
from fti.messages.reasons import Reason
from fti.nav.altimetry.validity import RULES, Sample, pencil_limits, reasons_against, wide_beam_limits

LIMITS = Altimeter(
    kind="radar",
    range_m=(1.0, 700.0),
    max_roll_deg=20.0,
    max_pitch_deg=15.0,
    max_deviation_m=8.0,
    max_nadir_deviation_m=10.0,
    max_dispersion=0.2,
    max_incidence_deg=50.0,
)
GOOD = Sample(
    value=100.0,
    age_ns=10,
    max_age_ns=100,
    roll=0.1,
    pitch=-0.1,
    predicted=104.0,
    predicted_sd=1.0,
    dispersion=19.0,
    incidence=0.3,
    navigated=98.0,
    ground_sd=2.0,
    height=99.0,
)


def _with(sample: Sample = GOOD, /, **change: Any) -> Sample:
    return structs.replace(sample, **change)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"has_samples": False, "value": None}, Reason.SILENT),
        ({"age_ns": 101}, Reason.STALE),
        ({"flagged": True}, Reason.DEVICE_FLAG),
        ({"value": None}, Reason.NO_RETURN),
        ({"value": 0.99, "predicted": None}, Reason.BELOW_RANGE),
        ({"value": 700.1, "predicted": None}, Reason.ABOVE_RANGE),
        ({"pitch": None}, Reason.NO_ATTITUDE),
        ({"roll": math.radians(-20.1)}, Reason.ROLL),
        ({"pitch": math.radians(15.1)}, Reason.PITCH),
        ({"predicted": 108.1}, Reason.DEVIATION),
        ({"predicted": 91.9}, Reason.DEVIATION),
        ({"height": 106.1}, Reason.NOT_NADIR),
        ({"height": 89.9}, Reason.NOT_NADIR),
        ({"dispersion": 19.7}, Reason.DISPERSION),
        ({"incidence": math.radians(50.1)}, Reason.INCIDENCE),
    ],
)
def test_each_rule_alone(change: dict[str, float | None], reason: Reason) -> None:
    assert reasons_against(GOOD, LIMITS) == ()
    assert reasons_against(_with(**change), LIMITS) == (reason,)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("value", Reason.NO_RETURN),
        ("roll", Reason.ROLL),
        ("pitch", Reason.PITCH),
        ("predicted", Reason.DEVIATION),
        ("height", Reason.NOT_NADIR),
        ("navigated", Reason.NOT_NADIR),
        ("ground_sd", Reason.NOT_NADIR),
        ("dispersion", Reason.DISPERSION),
        ("incidence", Reason.INCIDENCE),
    ],
)
def test_what_is_no_number_is_refused(name: str, reason: Reason) -> None:
    assert reason in reasons_against(_with(**{name: math.nan}), LIMITS)


@pytest.mark.parametrize("number", [math.inf, -math.inf])
@pytest.mark.parametrize("name", ["value", "roll", "pitch", "predicted", "height", "navigated", "incidence"])
def test_what_is_infinite_is_refused(name: str, number: float) -> None:
    assert reasons_against(_with(**{name: number}), LIMITS)


def test_what_known_errors_explain_is_not_held_against_the_sensor() -> None:
    off = _with(predicted=111.0, predicted_sd=4.0)
    assert reasons_against(off, LIMITS) == ()
    assert reasons_against(_with(off, predicted=112.1), LIMITS) == (Reason.DEVIATION,)


def test_a_navigated_height_that_may_be_wrong_vouches_for_less() -> None:
    near = _with(height=103.0)
    assert reasons_against(near, LIMITS) == ()
    assert reasons_against(_with(near, ground_sd=5.1), LIMITS) == (Reason.NOT_NADIR,)
    assert reasons_against(_with(near, ground_sd=11.0, height=98.0), LIMITS) == (Reason.NOT_NADIR,)


def test_the_sets_are_those_of_the_tables() -> None:
    laser, radar = pencil_limits((1.0, 1000.0)), wide_beam_limits((1.0, 762.0), 35.0, 26.0)
    flat = _with(roll=0.0, pitch=0.0, predicted=100.0, navigated=100.0, height=100.0)
    for limits, roll_deg, pitch_deg, deviation in ((laser, 10.0, 10.0, 5.0), (radar, 35.0, 26.0, 10.0)):
        for name, limit, reason in (
            ("roll", math.radians(roll_deg), Reason.ROLL),
            ("pitch", math.radians(pitch_deg), Reason.PITCH),
            ("predicted", deviation, Reason.DEVIATION),
        ):
            base = 100.0 if name == "predicted" else 0.0
            assert reasons_against(_with(flat, **{name: base + 0.999 * limit}), limits) == ()
            assert reasons_against(_with(flat, **{name: base + 1.001 * limit}), limits) == (reason,)
    far = _with(flat, height=110.1, ground_sd=0.0)
    assert reasons_against(far, laser) == ()
    assert reasons_against(far, radar) == (Reason.NOT_NADIR,)


numbers = st.none() | st.floats(-2000, 2000) | st.sampled_from([math.nan, math.inf, -math.inf])
angles = st.none() | st.floats(-1.5, 1.5) | st.just(math.nan)
samples = st.builds(
    Sample,
    value=numbers,
    flagged=st.booleans(),
    has_samples=st.booleans(),
    age_ns=st.integers(0, 200),
    max_age_ns=st.just(100),
    roll=angles,
    pitch=angles,
    predicted=numbers,
    predicted_sd=st.floats(0, 20),
    dispersion=st.none() | st.floats(0, 200),
    incidence=angles,
    navigated=numbers,
    ground_sd=st.floats(0, 20),
    height=numbers,
)


@given(samples)
def test_valid_means_inside_every_limit(sample: Sample) -> None:
    inside = (
        sample.has_samples
        and not sample.flagged
        and sample.age_ns <= 100
        and sample.value is not None
        and 1.0 <= sample.value <= 700.0
        and sample.roll is not None
        and sample.pitch is not None
        and abs(sample.roll) <= math.radians(20)
        and abs(sample.pitch) <= math.radians(15)
        and (sample.predicted is None or abs(sample.value - sample.predicted) <= max(8.0, 3.0 * sample.predicted_sd))
        and (
            sample.navigated is None
            or sample.height is None
            or abs(sample.height - sample.navigated) + sample.ground_sd <= 10.0
        )
        and (sample.dispersion is None or sample.navigated is None or sample.dispersion <= 0.2 * sample.navigated)
        and (sample.incidence is None or abs(sample.incidence) <= math.radians(50))
    )
    # a value that a silent device cannot have is judged too; it is never valid
    assert (not reasons_against(sample, LIMITS)) == inside


@given(samples)
def test_reasons_come_once_and_in_the_order_of_the_table(sample: Sample) -> None:
    order = [reason for reason, _ in RULES]
    found = [order.index(reason) for reason in reasons_against(sample, LIMITS)]
    assert found == sorted(set(found))


def test_a_terrain_that_is_not_asked_refuses_nothing() -> None:
    assert reasons_against(_with(predicted=None, dispersion=None, incidence=None, navigated=None), LIMITS) == ()


def test_a_negative_height_is_below_every_range() -> None:
    """A radar altimeter may say -6 ft on the ground; there is no height at P for it, so it is not valid."""
    ground = Altimeter(kind="radar", range_m=(-6.0, 700.0))
    assert reasons_against(Sample(value=-1.0, max_age_ns=1, roll=0.0, pitch=0.0), ground) == (Reason.BELOW_RANGE,)
