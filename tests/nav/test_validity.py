"""Validity: every rule alone, and properties that hold for every sample."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.config import Altimeter
from fti.nav.altimetry.validity import RULES, Sample, reasons_against
from fti.types import Reason

LIMITS = Altimeter(kind="radar", range_m=(1.0, 700.0), max_roll_deg=20.0, max_pitch_deg=15.0)
GOOD = {"value": 100.0, "age_ns": 10, "max_age_ns": 100, "roll": 0.1, "pitch": -0.1}


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"heard": False, "value": None}, Reason.SILENT),
        ({"age_ns": 101}, Reason.STALE),
        ({"flagged": True}, Reason.DEVICE_FLAG),
        ({"value": None}, Reason.NO_RETURN),
        ({"value": 0.99}, Reason.BELOW_RANGE),
        ({"value": 700.1}, Reason.ABOVE_RANGE),
        ({"pitch": None}, Reason.NO_ATTITUDE),
        ({"roll": math.radians(-20.1)}, Reason.ROLL),
        ({"pitch": math.radians(15.1)}, Reason.PITCH),
    ],
)
def test_each_rule_alone(change: dict[str, float | None], reason: Reason) -> None:
    assert reasons_against(Sample(**(GOOD | change)), LIMITS) == (reason,)  # type: ignore[arg-type]


samples = st.builds(
    Sample,
    value=st.none() | st.floats(-10, 2000),
    flagged=st.booleans(),
    heard=st.booleans(),
    age_ns=st.integers(0, 200),
    max_age_ns=st.just(100),
    roll=st.none() | st.floats(-1.5, 1.5),
    pitch=st.none() | st.floats(-1.5, 1.5),
)


@given(samples)
def test_valid_means_inside_every_limit(sample: Sample) -> None:
    inside = (
        sample.heard
        and not sample.flagged
        and sample.age_ns <= 100
        and sample.value is not None
        and 1.0 <= sample.value <= 700.0
        and sample.roll is not None
        and sample.pitch is not None
        and abs(sample.roll) <= math.radians(20)
        and abs(sample.pitch) <= math.radians(15)
    )
    reasons = reasons_against(sample, LIMITS)
    # a value that a silent device cannot have is judged too; it is never valid
    assert (not reasons) == inside


@given(samples)
def test_reasons_come_once_and_in_the_order_of_the_table(sample: Sample) -> None:
    order = [reason for reason, _ in RULES]
    found = [order.index(reason) for reason in reasons_against(sample, LIMITS)]
    assert found == sorted(set(found))


def test_a_negative_height_is_below_every_range() -> None:
    """A radar altimeter may say -6 ft on the ground; there is no height at P for it, so it is not valid."""
    ground = Altimeter(kind="radar", range_m=(-6.0, 700.0))
    assert reasons_against(Sample(value=-1.0, max_age_ns=1, roll=0.0, pitch=0.0), ground) == (Reason.BELOW_RANGE,)
