"""The two minutes behind the plots."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from fti.web.live_state import PERIOD_NS, SPAN_NS, History

HEIGHT = "/nav/height_above_ground/ra"
PERIOD_S = PERIOD_NS / 1e9
SPAN_S = SPAN_NS / 1e9
GLIDE = "/nav/glide_slope"


def height_at(t: float, **changes: Any) -> dict[str, Any]:
    return {"t_ns": round(t * 1e9), "valid": True, "late": False, "raw": 2 * t, "height_agl": t} | changes


def rows(history: History, series: str) -> list[tuple[float, float | None]]:
    message = history.message()
    return list(zip(message["t"], message["series"][series], strict=True))


def test_values_are_thinned_and_keep_their_time() -> None:
    history = History()
    for i in range(101):
        history.update(HEIGHT, height_at(i * 0.04))
    results = rows(history, f"{HEIGHT}:height_agl")
    assert len(results) == 21
    assert all(value is not None and abs(t - value) < 2e-9 for t, value in results)


def test_what_is_not_valid_is_a_gap_but_raw_stays() -> None:
    history = History()
    history.update(HEIGHT, height_at(1.0, valid=False))
    history.update(HEIGHT, height_at(2.0, late=True, valid=False))
    assert rows(history, f"{HEIGHT}:height_agl") == [(1.0, None), (2.0, None)]
    assert rows(history, f"{HEIGHT}:raw") == [(1.0, 2.0), (2.0, None)]


def test_a_silence_is_a_gap() -> None:
    history = History()
    history.update(HEIGHT, height_at(1.0))
    history.update(HEIGHT, height_at(9.0))
    assert rows(history, f"{HEIGHT}:raw") == [(1.0, 2.0), (1.0 + PERIOD_S, None), (9.0, 18.0)]


def test_a_series_that_begins_later_has_none_before() -> None:
    history = History()
    history.update(HEIGHT, height_at(1.0))
    history.update(GLIDE, {"t_ns": 2_000_000_000, "valid": True, "late": False, "deviation": 0.01, "dh": 3.0})
    assert rows(history, f"{GLIDE}:deviation") == [(1.0, None), (2.0, 0.01)]


@given(st.lists(st.floats(min_value=0.0, max_value=400.0), max_size=300))
def test_it_never_holds_more_than_its_span(times: list[float]) -> None:
    history = History()
    for t in times:
        history.update(HEIGHT, height_at(t))
    found = history.message()["t"]
    assert found == sorted(found)
    assert not found or found[-1] - found[0] <= SPAN_S + PERIOD_S
    assert len(found) <= SPAN_S / PERIOD_S + 3
