"""Two altimeters against each other: limits of autoland practice, views, memory, who is wrong; and the events."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from fti.config import Altimeter, parse
from fti.messages.measurements import Attitude, Position, RadioHeight, Range, Stamp, Velocity
from fti.messages.outputs import Compensation, Event, HeightAboveGround
from fti.messages.reasons import Reason
from fti.nav.altimetry.agreement import AgreementCheck
from fti.nav.pipeline import Pipeline

S = 1_000_000_000
T0 = 45_000 * S + 300_000_000  # 12:30:00.3 of a day
HZ = 10
RADAR = Altimeter(kind="radar", range_m=(0.5, 762.0), beam_deg=40.0)
LASER = Altimeter(kind="laser", range_m=(0.2, 700.0))
DISAGREE = (Reason.ALTIMETERS_DISAGREE,)


def height(sensor: str, k: int, value: float, *, known: bool = False, **changes: Any) -> HeightAboveGround:
    """A height of 0.1 m sigma, the k-th of ten a second; over known ground level and so predicted to 50 m."""
    ground: dict[str, Any] = {"compensation": Compensation.BEAM, "predicted": 50.0, "predicted_sd": 2.0}
    fields: dict[str, Any] = {"t_ns": T0 + k * S // HZ, "reasons": (), **(ground if known else {}), **changes}
    return HeightAboveGround(
        t_valid_ns=fields["t_ns"], sensor=sensor, raw=value, height_agl=value, sd=0.1, nearest=value, nearest_sd=0.1,
        valid=not fields["reasons"], **fields,
    )  # fmt: skip


def shares(radar_m: float, laser_m: float, *, known: bool = False, kinds: tuple[Altimeter, Altimeter] = (RADAR, LASER)) -> dict[str, float]:  # fmt: skip  # noqa: E501
    """Share of 5 s in which each is refused."""
    check, found = AgreementCheck(dict(zip(("radar", "laser"), kinds, strict=True))), {"radar": 0, "laser": 0}
    for k in range(5 * HZ):
        for sensor, value in (("radar", radar_m), ("laser", laser_m)):
            found[sensor] += check.update(height(sensor, k, value, known=known)) == DISAGREE
    return {sensor: n / (5 * HZ) for sensor, n in found.items()}


def is_valid(values: dict[str, float]) -> bool:
    return values == {"radar": 0.0, "laser": 0.0}


@pytest.mark.parametrize(("apart", "agree"), [(4.5, True), (5.5, False)])
def test_below_200_ft_15_ft_are_the_limit(apart: float, agree: bool) -> None:
    """And three sigmas of 0.14 m."""
    for kinds in ((RADAR, RADAR), (LASER, LASER)):
        assert is_valid(shares(50.0 + apart, 50.0, kinds=kinds)) is agree
        assert is_valid(shares(50.0, 50.0 + apart, kinds=kinds)) is agree


@pytest.mark.parametrize(("apart", "agree"), [(14.0, True), (17.0, False)])
def test_above_it_is_as_large_a_share(apart: float, agree: bool) -> None:
    """15 ft of 200 ft, at 200 m 15 m."""
    assert is_valid(shares(200.0 + apart, 200.0, kinds=(LASER, LASER))) is agree


def test_a_radar_may_be_shorter_than_a_laser_and_not_longer_over_unknown_ground() -> None:
    """25 m of trees, and 0.3 of slope over the 18 m to the edge of a beam of 40 deg."""
    assert is_valid(shares(25.0, 50.0))
    assert not is_valid(shares(56.0, 50.0))
    assert not is_valid(shares(10.0, 50.0))
    assert not is_valid(shares(40.0, 50.0, known=True)), "known ground says what the radar sees"


@pytest.mark.parametrize(("bias_m", "scale"), [(12.0, 1.0), (0.0, 1.24)])
def test_bias_and_scale_that_are_configured_are_no_disagreement(bias_m: float, scale: float) -> None:
    """A laser that says 62 m of 50 m."""
    kinds = LASER, LASER.model_copy(update={"bias_m": bias_m, "scale": scale})
    assert is_valid(shares(50.0, 62.0, kinds=kinds))
    assert not is_valid(shares(62.0, 50.0, kinds=kinds))


def test_both_are_refused_after_half_a_second_when_nobody_knows_better() -> None:
    values = shares(60.0, 50.0)
    assert values["radar"] == pytest.approx(0.88, abs=0.03)
    assert values["laser"] == pytest.approx(0.88, abs=0.03)


def test_known_ground_identifies_the_wrong_one() -> None:
    """50 m predicted, sigma 2 m: 57 m is 3.5 sigma, 50.5 m is none."""
    values = shares(57.0, 50.5, known=True)
    assert values["radar"] > 0.8
    assert values["laser"] == 0.0


def test_a_disagreement_of_two_samples_is_none() -> None:
    check = AgreementCheck({"radar": RADAR, "laser": LASER})
    for k in range(60):
        assert check.update(height("laser", k, 50.0)) == ()
        assert check.update(height("radar", k, 90.0 if k % 20 in {7, 8} else 50.0)) == ()


def test_it_ends_a_second_after_they_agree() -> None:
    check, last = AgreementCheck({"radar": RADAR, "laser": LASER}), {"radar": 0, "laser": 0}
    for k in range(60):
        for sensor, value in (("radar", 60.0 if k < 30 else 50.0), ("laser", 50.0)):
            if check.update(height(sensor, k, value)):
                last[sensor] = k
    assert {38, 39, 40} >= set(last.values())


def test_who_is_refused_for_another_reason_is_the_wrong_one() -> None:
    check = AgreementCheck({"radar": RADAR, "laser": LASER})
    for k in range(20):
        check.update(height("laser", k, 50.0))
        assert check.update(height("radar", k, 60.0)) == (DISAGREE if k > 4 else ())
    check.update(height("radar", 20, 60.0, reasons=(Reason.STUCK,)), {Reason.STUCK})
    assert check.update(height("laser", 21, 50.0)) == ()


def test_a_single_sample_that_deviates_does_not_decide_which_of_two_is_wrong() -> None:
    check = AgreementCheck({"radar": RADAR, "laser": LASER})
    for k in range(20):
        check.update(height("laser", k, 50.0))
        check.update(height("radar", k, 60.0))
    check.update(height("laser", 20, 50.0, reasons=(Reason.DEVIATION,)))
    assert check.update(height("radar", 21, 60.0)) == DISAGREE
    check.update(height("laser", 22, 50.0, reasons=(Reason.DEVIATION,)), {Reason.DEVIATION})
    assert check.update(height("radar", 23, 60.0)) == ()


def test_an_altimeter_that_falls_silent_leaves_the_other_alone_after_20_times_as_long_as_they_disagreed() -> None:
    """They disagree from 0.5 s to 2 s: for 30 s more."""
    check = AgreementCheck({"radar": RADAR, "laser": LASER})
    for k in range(20):
        check.update(height("laser", k, 50.0))
        check.update(height("radar", k, 60.0))
    reasons = [check.update(height("laser", k, 50.0)) for k in range(20, 400)]
    assert set(reasons[:250]) == {DISAGREE}
    assert set(reasons[310:]) == {()}


@pytest.mark.parametrize(("value", "is_valid"), [(51.0, True), (57.0, False)])
def test_who_is_left_alone_is_not_the_wrong_one_where_the_ground_confirms_it(value: float, is_valid: bool) -> None:
    """50 m predicted, sigma 2 m, once the laser is gone; before, the ground is unknown."""
    check = AgreementCheck({"radar": RADAR, "laser": LASER})
    for k in range(40):
        check.update(height("laser", k, value - 10.0))
        check.update(height("radar", k, value))
    reasons = [check.update(height("radar", k, value, known=True)) for k in range(40, 90)]
    assert set(reasons[:20]) == {DISAGREE}
    assert set(reasons[32:]) == {() if is_valid else DISAGREE}


def test_two_that_agree_in_moments_seconds_apart_are_still_refused() -> None:
    """For 0.1 s in 3: no second of agreement."""
    check = AgreementCheck({"radar": RADAR, "laser": LASER})
    for k in range(120):
        value = 50.0 if k > 20 and k % 30 < 2 else 60.0
        if k <= 20 or k % 30 < 2:
            check.update(height("radar", k, value))
        reasons = check.update(height("laser", k, 50.0))
    assert reasons == DISAGREE


def test_samples_are_compared_at_one_time() -> None:
    """Both fall at 10 m/s; the radar tells at 25 Hz, the laser at 4 Hz: held, it would be up to 2.5 m behind."""
    check = AgreementCheck({"radar": RADAR, "laser": RADAR})
    times = sorted([(k / 25, "radar", 4.4) for k in range(250)] + [(k / 4, "laser", 0.0) for k in range(40)])
    for t, sensor, wrong in times:
        assert check.update(height(sensor, 0, 160.0 - 10.0 * t + wrong, t_ns=T0 + round(t * S))) == ()


# --------------------------------------------------------------------------------------------------- in the pipeline


def pipeline() -> Pipeline:
    device = {"link": "l", "driver": "d"}
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [
            {"name": "ins", **device},
            {"name": "radar", "altimeter": {"kind": "radar", "range_m": [0.5, 762.0]}, **device},
            {"name": "laser", "altimeter": {"kind": "laser", "range_m": [0.2, 700.0], "sd_m": 0.1}, **device},
        ],
        "nav": {"attitude": ["ins"], "position": ["ins"], "altimeters": ["radar", "laser"]},
    }
    return Pipeline(parse(table, "", Path("t.toml")), None)


def test_a_stuck_radar_beside_a_laser_is_refused_alone_with_events_that_give_the_onset() -> None:
    """Without a terrain: a climb of 5 m/s from 100 m; from 5 s to 20 s the radar repeats its value."""
    of, events, heights = pipeline(), list[Event](), list[HeightAboveGround]()
    for k in range(40 * HZ):
        t, stamp = k / HZ, Stamp(T0 + k * S // HZ)
        up = 100.0 + 5.0 * t
        lat = 0.8 + 60.0 * t / 6.38e6
        value = 100.0 + 5.0 * 5.0 if 5.0 <= t < 20.0 else round(up / 1.5) * 1.5
        for device, m in (
            ("ins", Attitude(stamp=stamp, roll=0.0, pitch=0.0, heading=0.0)),
            ("ins", Position(stamp=stamp, lat=lat, lon=0.2, alt=500.0 + 5.0 * t, vertical_sd=2.0, horizontal_sd=2.0)),
            ("ins", Velocity(stamp=stamp, north=60.0, east=0.0, down=-5.0, sd=0.1)),
            ("radar", RadioHeight(stamp=stamp, height_agl=value, sd=0.5)),
            ("laser", Range(stamp=stamp, slant_range=up + 0.01 * (k % 7))),
        ):
            out = of.feed(device, m)
            events += [o for o in out if isinstance(o, Event)]
            heights += [o for o in out if isinstance(o, HeightAboveGround)]
    radar = [((o.t_ns - T0) / S, o) for o in heights if o.sensor == "radar"]
    assert all(not o.valid and Reason.STUCK in o.reasons for t, o in radar if 8.0 <= t < 21.9)
    assert all(o.valid for t, o in radar if t < 5.0 or t > 22.2)
    assert [(o.source, o.level) for o in events if "stuck" in o.text or "changes again" in o.text] == [
        ("radar", "warning"),
        ("radar", "info"),
    ]
    assert "since 12:30:05.3 UTC its value is stuck at 125.00 m" in events[0].text


@pytest.mark.parametrize("rate_hz", [20, 100, 400, 1000])
@pytest.mark.parametrize("late_s", [0.1, 0.9])
def test_a_fast_altimeter_is_compared_with_a_late_one(rate_hz: int, late_s: float) -> None:
    """A laser that says 40 m of 100 m; the radar's samples arrive so late."""
    check = AgreementCheck({"radar": RADAR, "laser": LASER})
    arrivals = [(k / rate_hz, "laser", k / rate_hz, 40.0) for k in range(4 * rate_hz)]
    arrivals += [(k / 20 + late_s, "radar", k / 20, 100.0) for k in range(80)]
    refused = list[float]()
    for at, sensor, t, value in sorted(arrivals):
        sample = replace(height(sensor, 0, value, t_ns=T0 + round(at * S)), t_valid_ns=T0 + round(t * S))
        if check.update(sample) == DISAGREE and sensor == "laser":
            refused.append(at)
    assert refused[0] < 0.6 + late_s + 0.1
    wanted = sum(refused[0] <= at < 4.0 for at, sensor, _, _ in arrivals if sensor == "laser")
    assert sum(at < 4.0 for at in refused) == wanted, "from then on"


def test_altimeters_at_1_hz_that_come_late_or_without_a_return_stay_compared() -> None:
    """A radar at 1 Hz that comes 1.5 s late; the laser has no return every half second."""
    check = AgreementCheck({"radar": RADAR, "laser": LASER})
    arrivals = [(k / 10, "laser", k / 10, 40.0) for k in range(200)]
    arrivals += [(k + 1.5, "radar", float(k), 100.0) for k in range(18)]
    refused = list[tuple[float, bool]]()
    for k, (at, sensor, t, value) in enumerate(sorted(arrivals)):
        reasons = (Reason.NO_RETURN,) if sensor == "laser" and k % 5 == 0 else ()
        sample = height(sensor, 0, value, t_ns=T0 + round(at * S), reasons=reasons)
        refused.append((at, check.update(replace(sample, t_valid_ns=T0 + round(t * S))) == DISAGREE))
    assert all(now for at, now in refused if 6.0 <= at < 18.0)


def seldom(period_s: float, radar_m: Callable[[float], float], seconds: float) -> dict[str, list[tuple[float, bool]]]:
    """A laser of 10 Hz at 50 m beside a radar with a sample in each period: times [s] and whether each is refused."""
    check = AgreementCheck({"radar": RADAR, "laser": LASER})
    samples = [(k / HZ, "laser", 50.0) for k in range(round(seconds * HZ))]
    radar_t = [0.003 + k * period_s for k in range(round(seconds / period_s))]
    rows: dict[str, list[tuple[float, bool]]] = {"radar": [], "laser": []}
    for t, sensor, value in sorted(samples + [(t, "radar", radar_m(t)) for t in radar_t]):
        refusals = check.update(height(sensor, 0, value, t_ns=T0 + round(t * S)))
        rows[sensor].append((t, bool(refusals)))
    return rows


@pytest.mark.parametrize("period_s", [1.0, 1.02, 1.5, 1.9])
def test_one_that_measures_seldom_is_compared(period_s: float) -> None:
    """40 m apart: with a sample in 1.001 s they were never compared three times."""
    rows = seldom(period_s, lambda t: 90.0, 60.0)
    assert all(refused for each in rows.values() for t, refused in each if t > 4 * period_s)


@pytest.mark.parametrize("period_s", [1.02, 1.9])
def test_two_that_agree_again_are_not_refused_for_ever_although_one_measures_seldom(period_s: float) -> None:
    """40 m apart for 10 s, and then alike: with a sample in 1.02 s both were refused to the end."""
    rows = seldom(period_s, lambda t: 90.0 if t < 10.0 else 50.0, 60.0)
    assert any(refused for _, refused in rows["laser"])
    assert not any(refused for t, refused in rows["laser"] if t > 16.0)


def test_a_prediction_that_proves_nothing_neither_decides_nor_confirms() -> None:
    """An altimeter that holds the altitude itself agrees with its own prediction; one in a wide gate with anything."""
    for unproven in (Reason.NOT_INDEPENDENT, Reason.UNCERTAIN, Reason.GROUND_CONTRADICTED):
        check, refusals = AgreementCheck({"radar": RADAR, "laser": LASER}), dict[str, tuple[Reason, ...]]()
        for k in range(10 * HZ):
            refusals["laser"] = check.update(height("laser", k, 50.0, known=True, unchecked=(unproven,)))
            refusals["radar"] = check.update(height("radar", k, 62.0, known=True))
        assert refusals == {"laser": DISAGREE, "radar": DISAGREE}
        alone = [check.update(height("laser", k, 50.0, known=True, unchecked=(unproven,))) for k in range(100, 160)]
        assert set(alone) == {DISAGREE}
