"""Simulated flights: order, determinism, devices, every fault against the same flight without it."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.messages.measurements import Attitude, ImuSample, Position, PressureAltitude, RadioHeight, Velocity
from fti.study.faults import CELLS, START_NS, Cell, SensorFault, SimulatedFlight, draw, flight
from fti.study.faults.cells import GRADES, SHARP
from fti.study.faults.receiver import Fixes

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
SECOND_NS = 1_000_000_000
M_PER_RAD = 6_371_000.0


@pytest.fixture(autouse=True)
def _early(monkeypatch: pytest.MonkeyPatch) -> None:
    """Faults begin after 130-150 s, so that flights are short."""
    monkeypatch.setattr(flight, "ONSET_S", (130.0, 150.0))


def twins(monkeypatch: pytest.MonkeyPatch, cell: Cell, seed: int = 3) -> tuple[SimulatedFlight, SimulatedFlight]:
    """The flight of a cell, and the same one without the effect of the fault."""
    faulty = draw(cell, seed)
    with monkeypatch.context() as patch:
        patch.setattr(flight, "apply_fault", lambda found, *_, **__: found)
        patch.setattr(flight, "_faulty_triad", lambda true_b, *_: true_b)
        patch.setattr(flight, "_baro_fault", lambda cell, window, t, rng: 0.0 * (rng.choice((-1.0, 1.0)) * t))
        return faulty, draw(cell, seed)


def span(f: SimulatedFlight, t: Array) -> Mask:
    """Mask of the time of the fault."""
    begin, end = ((at - START_NS) / SECOND_NS for at in (f.fault.onset_ns, f.fault.end_ns))
    return np.asarray((t >= begin) & (t < end))


def apart_n(a: Fixes, b: Fixes) -> Array:
    """a minus b, north, east [m] on a sphere, up."""
    east = (a.lon - b.lon) * np.cos(b.lat)
    return np.stack((M_PER_RAD * (a.lat - b.lat), M_PER_RAD * east, a.alt - b.alt), axis=1)


def receiver_twins(monkeypatch: pytest.MonkeyPatch, cell: Cell, name: str = "gnss_a") -> tuple[Fixes, Fixes, Mask]:
    faulty, nominal = twins(monkeypatch, cell)
    active = span(faulty, faulty.fixes[name].t)
    assert 1000 < active.sum() < len(active) - 500
    for column in ("lat", "lon", "alt", "alt_msl", "undulation", "vel_n"):
        a, b = (getattr(f.fixes[name], column)[~active] for f in (faulty, nominal))
        assert np.array_equal(a, b), f"{column} differs where there is no fault"
    return faulty.fixes[name], nominal.fixes[name], active


def level_error(f: SimulatedFlight, t_ns: int, m: Position) -> float:
    """Horizontal error of a position against the truth of a time [m]."""
    assert m.lat is not None and m.lon is not None and m.alt is not None
    return math.hypot(*f.error(t_ns, m.lat, m.lon, m.alt)[:2])


def test_names_are_unique_and_cover_the_table() -> None:
    assert len({cell.name for cell in CELLS}) == len(CELLS)
    assert {(c.grade, c.pattern) for c in CELLS} == {(g, p) for g in GRADES for p in ("legs", "turns")}
    assert {c.kind for c in CELLS} == set(SensorFault)
    ramps = {(c.magnitude, c.onset_m_s2) for c in CELLS if c.with_velocity and c.receivers == 1}
    assert {(r, a) for r in (0.1, 1.0, 3.0) for a in (SHARP, 0.02, 0.1, 0.3)} <= ramps
    assert {(c.receivers, c.faulty_receivers) for c in CELLS} == {(1, 1), (2, 1), (2, 2)}


def test_the_name_of_a_cell_does_not_change() -> None:
    cell = Cell(
        "tactical", SensorFault.RAMP, 1.0, 0.1, with_velocity=True, receivers=2, faulty_receivers=1, pattern="turns"
    )
    assert cell.name == "tactical/ramp-velocity-1-onset-0.1/1-of-2/turns"


def test_every_cell_draws() -> None:
    """All cells of one grade, whole, and one of each other: the fault is on the devices it names."""
    for cell in CELLS:
        if cell.grade != "tactical" and cell.kind is not SensorFault.NONE:
            continue
        f = draw(cell, 1)
        assert np.isfinite(f.inertial.accel_b).all() and np.isfinite(f.inertial.gyro_b).all()
        assert all(np.isfinite(x.lat).all() and np.isfinite(x.vel_n).all() for x in f.fixes.values())
        assert len(f.fixes) == cell.receivers
        assert (cell.kind is SensorFault.NONE) == (not f.fault.devices)
        assert f.fault.onset_ns <= f.fault.end_ns < START_NS + f.duration_s * SECOND_NS + 1
        if f.fault.devices and f.fault.devices[0] in f.fixes:
            assert len(f.fault.devices) == cell.faulty_receivers


def test_measurements_are_in_order_and_at_their_rates() -> None:
    f = draw(Cell("tactical", SensorFault.NONE, receivers=2), 4)
    rows = list(f)
    assert all(a[0] <= b[0] for a, b in itertools.pairwise(rows))
    counts = Counter((device, type(m)) for _, device, m in rows)
    assert counts["imu", ImuSample] == pytest.approx(25.0 * f.duration_s, abs=2)
    for name in ("gnss_a", "gnss_b"):
        assert counts[name, Position] == counts[name, Velocity]
        rate_hz = counts[name, Position] / f.duration_s
        assert min(abs(rate_hz - 5.0), abs(rate_hz - 10.0)) < 0.1
    assert counts["baro", PressureAltitude] == pytest.approx(5.0 * f.duration_s, abs=3)
    assert counts["ahrs", Attitude] == pytest.approx(5.0 * f.duration_s, abs=3)
    assert counts["radar", RadioHeight] > 0
    assert all(m.stamp.t_valid_ns == t_ns for t_ns, _, m in rows)


def test_a_seed_draws_the_same_flight_and_another_seed_another() -> None:
    cell = Cell("mems", SensorFault.RAMP, 1.0, 0.1, with_velocity=True)
    assert list(draw(cell, 5)) == list(draw(cell, 5))
    assert next(iter(draw(cell, 6))) != next(iter(draw(cell, 5)))
    other = dataclasses.replace(cell, grade="tactical")
    assert draw(other, 5).fault.onset_ns != draw(cell, 5).fault.onset_ns


def test_nominal_fixes_lie_about_the_truth_as_far_as_they_state() -> None:
    """20 flights: RMS of error over stated sigma of level, height and velocity 0.7-1.3; the barometer within 60 m."""
    ratios, pressures = list[tuple[float, float, float]](), list[float]()
    for seed in range(20):
        f = draw(Cell("tactical", SensorFault.NONE), seed)
        rows = [row for row in f if row[1] in {"gnss_a", "baro"}]
        for t_ns, _, m in rows[::97]:
            if isinstance(m, Position):
                assert m.lat is not None and m.lon is not None and m.alt is not None and m.alt_msl is not None
                assert m.horizontal_sd is not None and m.vertical_sd is not None
                north, east, down = f.error(t_ns, m.lat, m.lon, m.alt)
                ratios.append((north / m.horizontal_sd, east / m.horizontal_sd, down / m.vertical_sd))
                assert m.alt == pytest.approx(m.alt_msl + f.undulation, abs=1e-6)
            elif isinstance(m, PressureAltitude):
                pressures.append(m.alt_press + f.undulation - float(f.truth(t_ns).alt[0]))
    assert np.sqrt(np.mean(np.square(ratios), axis=0)) == pytest.approx([1.0, 1.0, 1.0], abs=0.3)
    assert np.std(pressures) > 1.0 and np.abs(pressures).max() < 120.0


def test_the_error_is_solution_minus_truth() -> None:
    f = draw(Cell("tactical", SensorFault.NONE), 2)
    t_ns = START_NS + 50 * SECOND_NS
    m = f.truth(t_ns)
    lat, lon, alt = m.lat[0], m.lon[0], m.alt[0]
    assert f.error(t_ns, lat, lon, alt) == (0.0, 0.0, 0.0)
    north, east, down = f.error(t_ns, lat + 1e-5, lon - 1e-5 + 2.0 * math.pi, alt + 3.0)
    assert north == pytest.approx(1e-5 * M_PER_RAD, rel=0.01)
    assert east == pytest.approx(-1e-5 * M_PER_RAD * math.cos(lat), rel=0.01)
    assert down == -3.0


# ------------------------------------------------------------------------------------------------------- faults


@pytest.mark.parametrize("kind", [SensorFault.FROZEN, SensorFault.FROZEN_POSITION])
def test_frozen_repeats_the_last_fix(monkeypatch: pytest.MonkeyPatch, kind: SensorFault) -> None:
    faulty, nominal, active = receiver_twins(monkeypatch, Cell("tactical", kind))
    last = int(np.argmax(active)) - 1
    for column in ("lat", "lon", "alt", "alt_msl"):
        assert set(getattr(faulty, column)[active]) == {getattr(nominal, column)[last]}
    repeats = nominal.vel_n[last] if kind is SensorFault.FROZEN else nominal.vel_n[active]
    assert (faulty.vel_n[active] == repeats).all()
    assert np.ptp(nominal.vel_n[active], axis=0).max() > 1.0, "a repeated velocity would equal a new one"


def test_a_jump_is_as_long_as_it_says_and_level(monkeypatch: pytest.MonkeyPatch) -> None:
    faulty, nominal, active = receiver_twins(monkeypatch, Cell("tactical", SensorFault.JUMP, 100.0))
    moved = apart_n(faulty, nominal)[active]
    assert np.linalg.norm(moved[:, :2], axis=1) == pytest.approx(np.full(active.sum(), 100.0), rel=0.01)
    assert (moved[:, 2] == 0.0).all()
    assert np.array_equal(faulty.vel_n, nominal.vel_n)


def test_swapped_latitude_and_longitude_are_thousands_of_kilometres_away(monkeypatch: pytest.MonkeyPatch) -> None:
    faulty, nominal, active = receiver_twins(monkeypatch, Cell("tactical", SensorFault.SWAPPED))
    assert np.array_equal(faulty.lat[active], nominal.lon[active])
    assert np.array_equal(faulty.lon[active], nominal.lat[active])
    a, b = ((x.lat[active][0], x.lon[active][0]) for x in (faulty, nominal))
    cosine = math.sin(a[0]) * math.sin(b[0]) + math.cos(a[0]) * math.cos(b[0]) * math.cos(a[1] - b[1])
    assert 4.5e6 < M_PER_RAD * math.acos(cosine) < 7.5e6


@pytest.mark.parametrize("onset", [SHARP, 0.02, 0.3])
@pytest.mark.parametrize("with_velocity", [False, True])
def test_a_ramp_is_the_integral_of_its_velocity(
    monkeypatch: pytest.MonkeyPatch, onset: float, with_velocity: bool
) -> None:
    """Rate min(a t, 1 m/s), summed in steps of 1 ms: within 1 %, for metres on a sphere, and 2 cm."""
    cell = Cell("tactical", SensorFault.RAMP, 1.0, onset, with_velocity=with_velocity)
    faulty, nominal, active = receiver_twins(monkeypatch, cell)
    begin = draw(cell, 3).fault.onset_ns / SECOND_NS - START_NS / SECOND_NS
    elapsed = faulty.t[active] - begin
    fine = np.arange(0.0, elapsed[-1] + 0.01, 0.001)
    rate = np.minimum(onset * (fine + 1e-12), 1.0)
    length = np.interp(elapsed, fine, np.cumsum(rate) * 0.001)
    moved = apart_n(faulty, nominal)[active]
    assert np.linalg.norm(moved[:, :2], axis=1) == pytest.approx(length, rel=0.01, abs=0.02)
    velocity = (faulty.vel_n - nominal.vel_n)[active]
    expected = np.interp(elapsed, fine, rate) if with_velocity else np.zeros(len(elapsed))
    assert np.linalg.norm(velocity, axis=1) == pytest.approx(expected, abs=0.002)
    if with_velocity:
        assert velocity[-1, :2] == pytest.approx(moved[-1, :2] / np.linalg.norm(moved[-1, :2]), abs=0.01)


def test_errors_of_a_small_stated_sigma_are_so_many_times_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """300 s of errors of 10 s are 15 independent ones: five flights, RMS within 35 %."""
    ratios = []
    for seed in range(5):
        faulty, nominal = twins(monkeypatch, Cell("tactical", SensorFault.SIGMA, 10.0), seed)
        a, b = faulty.fixes["gnss_a"], nominal.fixes["gnss_a"]
        assert a.horizontal_sd == b.horizontal_sd
        ratios.append(apart_n(a, b)[span(faulty, a.t)] / [a.horizontal_sd, a.horizontal_sd, a.vertical_sd])
    assert np.sqrt(np.mean(np.square(np.concatenate(ratios)), axis=0)) == pytest.approx([10.0] * 3, rel=0.35)


@pytest.mark.parametrize(
    ("kind", "size"), [(SensorFault.HEIGHT, 47.0), (SensorFault.MSL_HEIGHT, 0.0), (SensorFault.UNDULATION_ZERO, 0.0)]
)
def test_heights(monkeypatch: pytest.MonkeyPatch, kind: SensorFault, size: float) -> None:
    faulty, nominal, active = receiver_twins(monkeypatch, Cell("tactical", kind, size))
    undulation = nominal.undulation[0]
    assert 20.0 <= abs(undulation) <= 60.0
    raised = size if kind is SensorFault.HEIGHT else -undulation
    assert (faulty.alt - nominal.alt)[active] == pytest.approx(np.full(active.sum(), raised))
    assert faulty.undulation[active][0] == (0.0 if kind is SensorFault.UNDULATION_ZERO else undulation)
    assert np.array_equal(faulty.lat, nominal.lat)


def test_a_time_step_gives_the_fix_of_an_earlier_moment() -> None:
    """5 s at 60 m/s and more: fixes agree with the truth of then within 6 stated sigma, and not with that of now."""
    f = draw(Cell("tactical", SensorFault.TIME_STEP, 5.0), 3)
    struck = [(t_ns, m) for t_ns, _, m in f if isinstance(m, Position) and f.fault.onset_ns <= t_ns < f.fault.end_ns]
    assert len(struck) > 1000
    for t_ns, m in struck:
        assert m.horizontal_sd is not None
        assert level_error(f, t_ns - 5 * SECOND_NS, m) < 6.0 * m.horizontal_sd
    assert max(level_error(f, t_ns, m) for t_ns, m in struck) > 300.0 - 6.0 * 2.6


@pytest.mark.parametrize(
    ("kind", "size", "shape"),
    [
        (SensorFault.BARO_STEP, 30.0, lambda s: np.full(len(s), 30.0)),
        (SensorFault.QNH, 10.0, lambda s: np.full(len(s), 83.0)),
        (SensorFault.BARO_RAMP, 0.1, lambda s: 0.1 * s),
    ],
)
def test_barometer(
    monkeypatch: pytest.MonkeyPatch, kind: SensorFault, size: float, shape: Callable[[Array], Array]
) -> None:
    faulty, nominal = twins(monkeypatch, Cell("tactical", kind, size))
    t, active = faulty.baro[0], span(faulty, faulty.baro[0])
    moved = faulty.baro[1] - nominal.baro[1]
    assert (moved[~active] == 0.0).all()
    begin = (faulty.fault.onset_ns - START_NS) / SECOND_NS
    assert np.abs(moved[active]) == pytest.approx(shape(t[active] - begin), abs=1e-6)
    assert faulty.fault.devices == ("baro",)


def triads(f: SimulatedFlight, kind: SensorFault) -> tuple[Array, Array]:
    """The triad that a fault strikes, and the other."""
    pair = (f.inertial.accel_b, f.inertial.gyro_b)
    return pair if kind.startswith("accel") else pair[::-1]


@pytest.mark.parametrize(("kind", "size"), [(SensorFault.ACCEL_STEP, 0.05), (SensorFault.GYRO_STEP, math.radians(0.1))])
def test_a_step_of_a_bias_is_on_one_axis(monkeypatch: pytest.MonkeyPatch, kind: SensorFault, size: float) -> None:
    magnitude = size if kind is SensorFault.ACCEL_STEP else 0.1
    faulty, nominal = twins(monkeypatch, Cell("tactical", kind, magnitude))
    active = span(faulty, faulty.inertial.t)
    (a, other), (b, same) = triads(faulty, kind), triads(nominal, kind)
    moved = np.abs(a - b)
    assert (moved[~active] == 0.0).all() and np.array_equal(other, same)
    assert np.sort(moved[active], axis=1) == pytest.approx(np.tile([0.0, 0.0, size], (active.sum(), 1)), abs=1e-9)


@pytest.mark.parametrize("kind", [SensorFault.ACCEL_STUCK, SensorFault.GYRO_STUCK])
def test_a_stuck_axis_repeats_its_last_value(monkeypatch: pytest.MonkeyPatch, kind: SensorFault) -> None:
    faulty, nominal = twins(monkeypatch, Cell("tactical", kind))
    active = span(faulty, faulty.inertial.t)
    a, b = triads(faulty, kind)[0], triads(nominal, kind)[0]
    stuck = [axis for axis in range(3) if len(set(a[active, axis])) == 1]
    assert len(stuck) == 1
    assert a[active][0, stuck[0]] == b[int(np.argmax(active)) - 1, stuck[0]]
    live = [axis for axis in range(3) if axis != stuck[0]]
    assert np.array_equal(a[:, live], b[:, live]) and np.array_equal(a[~active], b[~active])


@pytest.mark.parametrize(
    ("kind", "limit"), [(SensorFault.ACCEL_SATURATED, 10.0), (SensorFault.GYRO_SATURATED, math.radians(3.0))]
)
def test_a_saturated_triad_stays_at_its_limit(monkeypatch: pytest.MonkeyPatch, kind: SensorFault, limit: float) -> None:
    magnitude = 10.0 if kind is SensorFault.ACCEL_SATURATED else 3.0
    faulty, nominal = twins(monkeypatch, Cell("tactical", kind, magnitude, pattern="turns"))
    active = span(faulty, faulty.inertial.t)
    a, b = triads(faulty, kind)[0], triads(nominal, kind)[0]
    inside = active[:, None] & (np.abs(b) <= limit)
    assert (a[inside] == b[inside]).all() and np.array_equal(a[~active], b[~active])
    beyond = active[:, None] & (np.abs(b) > limit)
    assert beyond.sum() > 50
    assert np.abs(a[beyond]) == pytest.approx(np.full(beyond.sum(), limit)) and (a[beyond] * b[beyond] > 0).all()


@pytest.mark.parametrize("faulty_receivers", [1, 2])
def test_of_two_receivers_one_lies_or_both_alike(monkeypatch: pytest.MonkeyPatch, faulty_receivers: int) -> None:
    cell = Cell(
        "tactical", SensorFault.RAMP, 1.0, 0.1, with_velocity=True, receivers=2, faulty_receivers=faulty_receivers
    )
    faulty, nominal = twins(monkeypatch, cell)
    moved = {name: apart_n(faulty.fixes[name], nominal.fixes[name]) for name in faulty.fixes}
    assert faulty.fault.devices == (("gnss_b",) if faulty_receivers == 1 else ("gnss_a", "gnss_b"))
    assert np.abs(moved["gnss_b"]).max() > 100.0
    if faulty_receivers == 1:
        assert (moved["gnss_a"] == 0.0).all()
    else:
        assert moved["gnss_a"] == pytest.approx(moved["gnss_b"], abs=0.01)


def test_turns_are_flown_during_the_fault() -> None:
    """Share of the time at more than 10 deg of bank, of ten flights: most of it in turns, less on legs."""
    share = {}
    for pattern in ("legs", "turns"):
        banks = []
        for seed in range(10):
            f = draw(Cell("tactical", SensorFault.NONE, pattern=pattern), seed)
            banks.append(np.abs(f.trajectory.at(np.arange(200.0, f.duration_s)).rpy[:, 0]) > math.radians(10.0))
        share[pattern] = float(np.mean(np.concatenate(banks)))
    assert share["turns"] > 0.6 > 0.4 > share["legs"]


def test_alignment_is_level_and_straight() -> None:
    for seed in range(5):
        m = draw(Cell("tactical", SensorFault.NONE), seed).trajectory.at(np.arange(0.0, 120.0))
        assert np.abs(m.rpy[:, 0]).max() == 0.0 and np.ptp(m.rpy[:, 2]) == 0.0 and np.abs(m.vel_n[:, 2]).max() == 0.0
