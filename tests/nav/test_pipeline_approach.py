"""An approach through the whole pipeline: measurements and ticks in, integrity and glide slope out."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from fti.config import Config, parse
from fti.errors import ConfigError
from fti.messages.measurements import Attitude, Measurement, Position, RadioHeight, Stamp, Velocity
from fti.messages.outputs import ClearanceIntegrity, Event, GlideSlope, IntegrityState, NavSolution, Output
from fti.messages.reasons import Reason
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.monitor import ClearanceSample
from fti.nav.integrity.reference import ApproachReference
from fti.nav.pipeline import Pipeline

MS = 1_000_000
S = 1_000_000_000
Inputs = list[tuple[int, str, Measurement | None]]
Flight = Callable[..., Iterator[ClearanceSample]]


def config(beam_deg: float = 40.0, kind: str = "radar", **approach: Any) -> Config:
    device = {"link": "l", "driver": "d"}
    altimeter = {"kind": kind, "range_m": [1.0, 700.0], "beam_deg": beam_deg}
    table = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [
            {"name": "ins", "max_age_ms": 300.0, "latency_ms": 5.0, **device},
            {"name": "gnss", "max_age_ms": 900.0, **device},
            {"name": "radar", "max_age_ms": 200.0, "latency_ms": 60.0, "altimeter": altimeter, **device},
        ],
        "nav": {
            "attitude": ["ins"],
            "position": ["ins", "gnss"],
            "altimeters": ["radar"],
            "approach": {"profile": "p.csv", "alert_v_m": 12.0, **approach},
        },
    }
    return parse(table, "", Path("t.toml"))


def inputs_of(path: ApproachPath, flight: Iterator[ClearanceSample], ins_hz: int = 10) -> Inputs:
    """Measurements as they arrive: altimeter 60 ms late at 25 Hz, INS 5 ms late, and a tick every 20 ms."""
    inputs: Inputs = []
    for k, x in enumerate(flight):
        stamp = Stamp(x.t_ns + 60 * MS)
        inputs.append((stamp.t_rx_ns, "radar", RadioHeight(stamp=stamp, height_agl=x.agl, sd=0.5)))
        inputs += [(x.t_ns + tick * MS, "", None) for tick in (1, 21)]
        if k % (25 // ins_hz) == 0:
            inputs += [(x.t_ns + 5 * MS, "ins", m) for m in ins_messages(path, x, Stamp(x.t_ns + 5 * MS))]
    return sorted(inputs, key=lambda item: item[0])


def ins_messages(path: ApproachPath, x: ClearanceSample, stamp: Stamp) -> list[Measurement]:
    lat, lon = (float(v) for v in path.to_geodetic(x.s, x.y))
    course = math.radians(path.airfield.course_deg)
    down = 60.0 * math.tan(path.glide)
    return [
        Attitude(stamp=stamp, roll=x.roll, pitch=x.pitch, heading=course, roll_sd=1e-3, pitch_sd=1e-3),
        Position(stamp=stamp, lat=lat, lon=lon, alt=x.alt, horizontal_sd=1.0, vertical_sd=1.0),
        Velocity(stamp=stamp, north=60 * math.cos(course), east=60 * math.sin(course), down=down, sd=0.05),
    ]


def fly(pipeline: Pipeline, inputs: Inputs) -> list[Output | Event]:
    out: list[Output | Event] = []
    for t_ns, device, m in inputs:
        out += pipeline.tick(t_ns) if m is None else pipeline.feed(device, m)
    return out


def integrity(outputs: list[Output | Event]) -> list[ClearanceIntegrity]:
    return [o for o in outputs if isinstance(o, ClearanceIntegrity)]


def slopes(outputs: list[Output | Event]) -> list[GlideSlope]:
    return [o for o in outputs if isinstance(o, GlideSlope)]


@pytest.fixture
def nominal(path: ApproachPath, flight: Flight) -> Inputs:
    return inputs_of(path, flight(begin=2500.0, end=600.0, height=4.0))


def test_nominal_approach_is_ok_and_the_needle_shows_what_is_flown(
    reference: ApproachReference, path: ApproachPath, nominal: Inputs
) -> None:
    outputs = fly(Pipeline(config(), reference), nominal)
    good = {IntegrityState.ACQUIRE, IntegrityState.OK, IntegrityState.MONITOR}
    assert {o.state for o in integrity(outputs) if o.t_ns > 2 * S} <= good
    glide_slopes = [o for o in slopes(outputs) if o.valid]
    assert len(glide_slopes) > 80
    for o in glide_slopes:
        assert o.s is not None and o.deviation is not None and o.sd is not None
        assert abs(o.deviation - math.atan2(o.s * math.tan(path.glide) + 4.0, o.s) + path.glide) < 3 * o.sd
        assert o.dh_nav == pytest.approx(4.0, abs=0.1)


def test_latency_and_extrapolation_put_the_height_where_it_was_measured(
    reference: ApproachReference, nominal: Inputs
) -> None:
    outputs = [o for o in integrity(fly(Pipeline(config(), reference), nominal)) if o.state is IntegrityState.OK]
    assert np.mean([o.shift or 0.0 for o in outputs]) == pytest.approx(0.0, abs=1.0)
    for o in outputs:
        assert (o.t_valid_ns or 0) - S == pytest.approx((2500.0 - (o.s_end or 0.0)) / 60.0 * S, abs=0.002 * S)


def test_every_output_comes_at_least_twice_a_second(reference: ApproachReference, nominal: Inputs) -> None:
    outputs = fly(Pipeline(config(), reference), nominal)
    for kind in (ClearanceIntegrity, GlideSlope, NavSolution):
        times = [o.t_ns for o in outputs if isinstance(o, kind)]
        assert max(np.diff(times)) <= 0.56 * S


def test_two_runs_give_the_same_bytes(reference: ApproachReference, nominal: Inputs) -> None:
    first, second = ([repr(o) for o in fly(Pipeline(config(), reference), nominal)] for _ in range(2))
    assert first == second


def test_a_silent_altimeter_takes_integrity_and_needle_away(reference: ApproachReference, nominal: Inputs) -> None:
    stop = S + 10 * S
    inputs = [(t, d, m) for t, d, m in nominal if d != "radar" or t < stop]
    outputs = fly(Pipeline(config(), reference), inputs)
    unavailable = [o for o in integrity(outputs) if o.t_ns >= stop and o.state is IntegrityState.UNAVAILABLE]
    assert unavailable[0].t_ns - stop <= (200 + 40) * MS
    assert {o.reasons for o in unavailable} == {(Reason.STALE,)}
    assert not any(o.valid for o in slopes(outputs) if o.t_ns >= unavailable[0].t_ns)
    times = [o.t_ns for o in unavailable]
    assert max(np.diff(times)) <= 0.52 * S


def test_an_altimeter_that_flags_its_height_is_refused(reference: ApproachReference, nominal: Inputs) -> None:
    stop = S + 10 * S

    def flagged(t: int, m: Measurement | None) -> Measurement | None:
        return structs.replace(m, valid=False) if isinstance(m, RadioHeight) and t >= stop else m

    outputs = fly(Pipeline(config(), reference), [(t, d, flagged(t, m)) for t, d, m in nominal])
    unavailable = next(o for o in integrity(outputs) if o.state is IntegrityState.UNAVAILABLE and o.t_ns >= stop)
    assert unavailable.reasons == (Reason.DEVICE_FLAG,)
    assert unavailable.t_ns - stop <= 240 * MS


def test_lost_position_is_named(reference: ApproachReference, nominal: Inputs) -> None:
    stop = S + 10 * S
    inputs = [(t, d, m) for t, d, m in nominal if not isinstance(m, (Position, Velocity)) or t < stop]
    outputs = fly(Pipeline(config(), reference), inputs)
    unavailable = integrity(outputs)[-1]
    assert (unavailable.state, unavailable.reasons) == (IntegrityState.UNAVAILABLE, (Reason.NO_POSITION,))
    assert slopes(outputs)[-1].s is None


def test_another_source_of_the_height_begins_a_new_window(reference: ApproachReference, nominal: Inputs) -> None:
    stop = S + 12 * S
    inputs: Inputs = []
    for t, d, m in nominal:
        if isinstance(m, (Position, Velocity)):
            inputs.append((t, "gnss", m))
            if t >= stop:
                continue
        inputs.append((t, d, m))
    outputs = fly(Pipeline(config(), reference), inputs)
    states = [o.state for o in integrity(outputs) if o.t_ns > stop]
    assert IntegrityState.ACQUIRE in states
    assert any("gnss instead of ins" in o.text for o in outputs if isinstance(o, Event))


def idle(pipeline: Pipeline) -> tuple[IntegrityState, tuple[Reason, ...], int]:
    outputs = integrity([o for k in range(100) for o in pipeline.tick(k * 20 * MS)])
    return outputs[-1].state, outputs[-1].reasons, len(outputs)


def test_without_a_profile_it_reports_so_twice_a_second() -> None:
    assert idle(Pipeline(config(), None)) == (IntegrityState.NO_PROFILE, (Reason.NO_PROFILE,), 4)


@pytest.mark.parametrize(("beam", "kind"), [(50.0, "radar"), (40.0, "laser")])
def test_another_kind_of_sensor_is_refused(reference: ApproachReference, beam: float, kind: str) -> None:
    state, reasons, _ = idle(Pipeline(config(beam, kind), reference))
    assert (state, reasons) == (IntegrityState.UNAVAILABLE, (Reason.WRONG_SENSOR,))


def test_another_window_than_the_calibrated_one_is_a_mistake(reference: ApproachReference) -> None:
    with pytest.raises(ConfigError, match=r"nav\.approach\.window_m = 300"):
        Pipeline(config(window_m=300.0), reference)


@pytest.mark.parametrize("alert_s_m", [2.0, 205.0])
def test_an_alert_limit_where_the_peak_cannot_be_looked_at_is_a_mistake(
    reference: ApproachReference, alert_s_m: float
) -> None:
    """Below one step the shift would never be observable and never tested; beyond the last there is no J."""
    with pytest.raises(ConfigError, match=rf"nav\.approach\.alert_s_m = {alert_s_m}: must be 5\.0 to 200\.0"):
        Pipeline(config(alert_s_m=alert_s_m), reference)


def test_an_altimeter_without_samples_is_silent_for_the_monitor_too(reference: ApproachReference) -> None:
    outputs = integrity([o for k in range(60) for o in Pipeline(config(), reference).tick(k * 20 * MS)])
    assert outputs == []
    pipeline = Pipeline(config(), reference)
    results = integrity([o for k in range(60) for o in pipeline.tick(k * 20 * MS)])
    assert results[0].state is IntegrityState.UNAVAILABLE
    assert Reason.SILENT in results[0].reasons
