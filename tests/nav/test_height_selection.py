"""Which altimeter gives the height below the aircraft."""

from __future__ import annotations

from fti.messages.outputs import Compensation, HeightAboveGround, HeightBelowAircraft
from fti.messages.reasons import Reason
from fti.nav.altimetry.selection import HeightSelector

STEP = 40_000_000


def height(sensor: str, k: int, sd: float, *, valid: bool = True, late_ns: int = 0) -> HeightAboveGround:
    return HeightAboveGround(
        t_ns=k * STEP,
        t_valid_ns=k * STEP - late_ns,
        sensor=sensor,
        raw=100.0,
        height_agl=100.0 + sd,
        sd=sd,
        valid=valid,
        reasons=() if valid else (Reason.NO_RETURN,),
        compensation=Compensation.BEAM,
    )


def chosen(outputs: list[HeightBelowAircraft]) -> list[str]:
    return [output.sensor for output in outputs if output.valid]


def test_each_sample_of_the_chosen_one_is_a_height_and_of_the_others_none() -> None:
    selector = HeightSelector(["radar", "laser"])
    heights = [o for k in range(5) for name in ("radar", "laser") for o in selector.feed(height(name, k, 1.0))]
    assert chosen(heights) == ["radar"] * 5
    assert (heights[0].height_agl, heights[0].sd, heights[0].compensation) == (101.0, 1.0, Compensation.BEAM)


def test_the_one_with_the_smaller_sigma_takes_over_when_that_has_lasted() -> None:
    selector = HeightSelector(["radar", "laser"])
    heights = [
        o
        for k in range(100)
        for name, sd in (("radar", 2.0), ("laser", 0.5))
        for o in selector.feed(height(name, k, sd))
    ]
    names = chosen(heights)
    assert names[0] == "radar" and names[-1] == "laser"
    assert 45 <= names.index("laser") <= 52  # two seconds
    assert names == sorted(names, reverse=True)  # and it stays


def test_sigmas_that_are_nearly_equal_do_not_alternate() -> None:
    selector = HeightSelector(["radar", "laser"])
    sds = [(1.0 + 0.2 * (k % 2), 1.2 - 0.2 * (k % 2)) for k in range(200)]
    heights = [
        o
        for k, pair in enumerate(sds)
        for name, sd in zip(("radar", "laser"), pair, strict=True)
        for o in selector.feed(height(name, k, sd))
    ]
    assert set(chosen(heights)) == {"radar"}


def test_another_valid_one_takes_the_place_of_one_that_is_not_at_once() -> None:
    selector = HeightSelector(["radar", "laser"])
    selector.feed(height("radar", 0, 1.0))
    selector.feed(height("laser", 0, 5.0))
    assert selector.feed(height("radar", 1, 1.0, valid=False)) == []
    assert chosen(selector.feed(height("laser", 1, 5.0))) == ["laser"]
    assert selector.feed(height("radar", 2, 4.0)) == []  # it stays where it is, and is not much better


def test_without_a_valid_one_there_is_no_height_and_the_reason() -> None:
    selector = HeightSelector(["radar", "laser"])
    assert [o.sensor for o in selector.feed(height("laser", 0, 1.0, valid=False))] == []
    (output,) = selector.feed(height("radar", 0, 1.0, valid=False))
    assert (output.valid, output.height_agl, output.sd, output.reasons) == (False, None, None, (Reason.NO_HEIGHT,))


def test_an_older_height_after_a_newer_one_is_left_out() -> None:
    selector = HeightSelector(["radar", "laser"])
    selector.feed(height("radar", 10, 1.0))
    selector.feed(height("radar", 11, 1.0, valid=False))
    assert selector.feed(height("laser", 11, 1.0, late_ns=5 * STEP)) == []
    assert chosen(selector.feed(height("laser", 12, 1.0))) == ["laser"]
