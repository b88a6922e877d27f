"""Flights of the second receiver through the product's altimeter channel: errors of heights over their sigmas."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fti.config import Device
from fti.nav.altimetry.altimeter_channel import AltimeterChannel, AltimeterReading
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import AttitudeState, PositionState
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain
from tests.second_receiver.flights import Flight, StatedSigmas, fly, navigate
from tests.second_receiver.geometry import LAT0, LON0, body_to_enu, to_geodetic
from tests.second_receiver.ground import ElevationModel, Surface, make_surface, survey
from tests.second_receiver.laser import Laser
from tests.second_receiver.radar import Radar

if TYPE_CHECKING:
    from fti.messages.outputs import HeightAboveGround

Array = NDArray[np.float64]

#: Pairs of value and sigma that an output may have; those that it has are judged.
FIELDS = {"height_agl": "sd", "compensated": "compensated_sd", "nearest": "nearest_sd"}
LEVER_ARM_B = (1.2, -0.4, 0.6)
RANGE_M = (1.0, 800.0)
STATED = StatedSigmas()
#: Alignment of a laser's axis [rad], each of two angles; in the stated attitude, as a configuration has no key for it.
ALIGNMENT = float(np.deg2rad(0.3))
POSTS_M = (5.0, 10.0)
#: Over each surface.
FLIGHTS = 4
#: Where the ground is unknown the product may learn from what it sees: 5 Hz for 10 s before every 10th sample counts.
LEARNING_PERIOD_S, LEARNING_SAMPLES, LEARNING_COUNT, LEARNING_EACH = 0.2, 170, 50, 10


@dataclass(frozen=True, slots=True)
class Case:
    """A case: ground and sensor.

    ground : level, hills, woods;  sensor : radar, laser;  known : whether the product has a terrain
    model  : of a radar, as the product is configured;  steps : whether a radar has those of an RA-4500, or none
    """

    ground: str
    sensor: str
    known: bool = True
    model: str = "nearest"
    steps: bool = True

    def __str__(self) -> str:
        words = (
            self.ground,
            self.sensor,
            "beam" * (self.model == "beam"),
            "fine" * (not self.steps),
            "unknown" * (not self.known),
        )
        return " ".join(word for word in words if word)

    @property
    def stream(self) -> int:
        """Seed of a flight: the same ground and flight whether it is known or not."""
        return ("level", "hills", "woods").index(self.ground) * 10 + ("radar", "laser").index(self.sensor)


@dataclass(eq=False)
class Samples:
    """Result of one flight: errors and sigmas [m] by name of a value, and their conditions.

    conditions : columns height above ground [m], relief [m], angle off the vertical [rad]
    """

    offered: int = 0
    errors: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in FIELDS})
    sds: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in FIELDS})
    conditions: list[tuple[float, float, float]] = field(default_factory=list)
    absent: dict[str, int] = field(default_factory=lambda: dict.fromkeys(FIELDS, 0))
    reasons: dict[str, int] = field(default_factory=dict)

    @property
    def valid(self) -> int:
        return len(self.conditions)


def terrain_of(model: ElevationModel) -> Terrain:
    """The product's terrain of an elevation model."""
    return Terrain.from_array(model.heights, model.cell_m, lat0=LAT0, lon0=LON0, east0=model.east0, north0=model.north0)


def device_of(case: Case) -> Device:
    """An altimeter with the defaults of [device.altimeter]."""
    altimeter = {"kind": case.sensor, "range_m": RANGE_M}
    if case.model != "nearest":
        altimeter["model"] = case.model
    return Device.model_validate(
        {
            "name": "altimeter",
            "link": "line",
            "driver": "freeflight_ra4500" if case.sensor == "radar" else "lightware_ascii",
            "altimeter": altimeter,
            "lever_arm_b": LEVER_ARM_B,
        }
    )


def run_site(case: Case, number: int, seed: int = 1) -> list[Samples]:
    """Flights over one surface, each with navigation errors, and with a receiver, of its own."""
    site = _make_site(case.ground, (seed, case.stream, number))
    ground = Ground(terrain_of(site.model), site.model.sd, "second receiver") if case.known else None
    return [_run_flight(case, site.surface, ground, np.random.default_rng(stream)) for stream in site.streams]


@dataclass(frozen=True, eq=False)
class _Site:
    """A surface, its survey, and the seeds of the flights over it."""

    surface: Surface
    model: ElevationModel
    streams: tuple[int, ...]


@functools.lru_cache(maxsize=4)  # the quick sites of a case, for the next case over the same ground
def _make_site(kind: str, seeds: tuple[int, ...]) -> _Site:
    rng = np.random.default_rng(seeds)
    surface = make_surface(kind, rng)
    model = survey(surface, float(rng.choice(POSTS_M)), rng)
    return _Site(surface, model, tuple(int(rng.integers(2**63)) for _ in range(FLIGHTS)))


def run_sites(case: Case, sites: int, seed: int = 1) -> list[Samples]:
    """Flights over so many surfaces."""
    return [flight for number in range(sites) for flight in run_site(case, number, seed)]


def _run_flight(case: Case, surface: Surface, ground: Ground | None, rng: np.random.Generator) -> Samples:
    period, n = (2.0, 12) if case.known else (LEARNING_PERIOD_S, LEARNING_SAMPLES)
    flight = fly(surface, rng, period=period, n=n)
    ranges, sds = _measure(case, surface, flight, rng)
    navigated = navigate(flight, STATED, rng)
    channel = AltimeterChannel(device_of(case))
    channel.set_terrain(ground)
    attitude_sd = np.hypot(STATED.attitude, ALIGNMENT) if case.sensor == "laser" else STATED.attitude
    samples = Samples()
    truth = flight.place[:, 2] - surface.height(flight.place[:, 0], flight.place[:, 1])
    for k, output in enumerate(_outputs(channel, navigated, ranges, sds, float(attitude_sd))):
        if not case.known and (k < LEARNING_COUNT or k % LEARNING_EACH):
            continue
        tilt = float(np.arccos(np.cos(flight.roll[k]) * np.cos(flight.pitch[k])))
        _collect(samples, output, float(truth[k]), (float(truth[k]), surface.relief, tilt))
    return samples


def _measure(case: Case, surface: Surface, flight: Flight, rng: np.random.Generator) -> tuple[Array, Array]:
    """Ranges [m] and their stated sigmas."""
    off = rng.normal(0.0, ALIGNMENT, 2) if case.sensor == "laser" else np.zeros(2)
    tilted = body_to_enu(off[0], off[1], 0.0)
    level = body_to_enu(0.0, 0.0, 0.0)
    axes = flight.axes()
    place = flight.place + axes @ np.array(LEVER_ARM_B)
    width = float(np.deg2rad(40.0 * rng.uniform(0.9, 1.1)))
    altimeter = (
        Laser() if case.sensor == "laser" else Radar(width=width, steps=case.steps, sweeps=4 if case.known else 2)
    )
    ranges = altimeter.measure(surface, place, axes @ (level.T @ tilted), flight.velocity, rng)
    return ranges, altimeter.sd(ranges)


def _outputs(
    channel: AltimeterChannel, navigated: Flight, ranges: Array, sds: Array, attitude_sd: float
) -> Iterator[HeightAboveGround]:
    lat, lon, alt = to_geodetic(navigated.place)
    for k in range(len(navigated.t)):
        t_ns = 10**9 + round((navigated.t[k] - navigated.t[0]) * 1e9)
        east, north, up = (float(v) for v in navigated.velocity[k])
        attitude = AttitudeState(
            float(navigated.roll[k]), float(navigated.pitch[k]), float(navigated.heading[k]), attitude_sd, attitude_sd
        )
        where = (float(lat[k]), float(lon[k]), float(alt[k]))
        position = PositionState(*where, STATED.horizontal, STATED.vertical, north, east, -up, t_ns)
        reading = AltimeterReading(t_ns, t_ns, float(ranges[k]), float(sds[k]), False)
        yield channel.feed(reading, NavState(t_ns, attitude, position, "ins", "ins"))


def _collect(samples: Samples, output: HeightAboveGround, truth: float, conditions: tuple[float, float, float]) -> None:
    samples.offered += 1
    if not output.valid:
        for reason in output.reasons:
            samples.reasons[str(reason)] = samples.reasons.get(str(reason), 0) + 1
        return
    samples.conditions.append(conditions)
    for name, of_sd in FIELDS.items():
        value, sd = getattr(output, name, None), getattr(output, of_sd, None)
        if value is None or sd is None:
            samples.absent[name] += 1
            value = sd = np.nan
        samples.errors[name].append(value - truth)
        samples.sds[name].append(sd)


# ---------------------------------------------------------------------------------------------------------- judging


@dataclass(frozen=True, slots=True)
class HeightScore:
    """Result of one value in one case, pooled over its flights.

    within_1, within_2 : shares of |z| < 1 and < 2;  rms_z;  bias, spread, stated : of the error and of its sigma [m]
    worst              : the flight with the least share of |z| < 2
    """

    n: int
    within_1: float
    within_2: float
    rms_z: float
    bias: float
    spread: float
    stated: float
    worst: float

    @property
    def holds(self) -> bool:
        """|z| < 1 in at least 60 %, |z| < 2 in at least 93 %, and no inflated sigma."""
        return self.within_1 >= 0.60 and self.within_2 >= 0.93 and self.rms_z >= 0.5


def judge(flights: list[Samples], name: str) -> HeightScore | None:
    """None where no output has the value."""
    errors = np.concatenate([np.array(f.errors[name], dtype=np.float64) for f in flights])
    sds = np.concatenate([np.array(f.sds[name], dtype=np.float64) for f in flights])
    known = np.isfinite(errors)
    if not known.any():
        return None
    errors, sds = errors[known], sds[known]
    z = errors / sds
    by_flight = [np.array(f.errors[name]) / np.array(f.sds[name]) for f in flights]
    worst = min(float(np.mean(np.abs(of) < 2.0)) for of in by_flight if np.isfinite(of).any())
    return HeightScore(
        n=len(z),
        within_1=float(np.mean(np.abs(z) < 1.0)),
        within_2=float(np.mean(np.abs(z) < 2.0)),
        rms_z=float(np.sqrt(np.mean(z**2))),
        bias=float(errors.mean()),
        spread=float(errors.std()),
        stated=float(np.sqrt(np.mean(sds**2))),
        worst=worst,
    )


TITLE = (
    f"{'case':<22} {'value':<12} {'valid':>9} {'|z|<1':>6} {'|z|<2':>6} {'rms z':>6} {'bias':>7} {'sd err':>7} "
    f"{'stated':>7} {'worst':>6}"
)


def lines(case: Case, flights: list[Samples]) -> Iterator[str]:
    """A line for each value that the outputs have."""
    offered = sum(f.offered for f in flights)
    for name in FIELDS:
        result = judge(flights, name)
        if result:
            yield (
                f"{case!s:<22} {name:<12} {result.n:>4}/{offered:<4} {result.within_1:>6.1%} {result.within_2:>6.1%} "
                f"{result.rms_z:>6.2f} {result.bias:>+7.2f} {result.spread:>7.2f} {result.stated:>7.2f} "
                f"{result.worst:>6.0%}{'' if result.holds else '  FAILS'}"
            )


def details(flights: list[Samples], name: str | None = None) -> Iterator[str]:
    """Samples that were not valid, by reason; errors by height above ground and by tilt."""
    reasons: dict[str, int] = {}
    for flight in flights:
        for reason, count in flight.reasons.items():
            reasons[reason] = reasons.get(reason, 0) + count
    yield f"    not valid: {reasons}"
    names = [name] if name else [n for n in FIELDS if any(np.isfinite(f.errors[n]).any() for f in flights)]
    conditions = np.concatenate([np.array(f.conditions).reshape(-1, 3) for f in flights])
    groups = {
        "height 40-100": conditions[:, 0] < 100.0,
        "height 100-200": (conditions[:, 0] >= 100.0) & (conditions[:, 0] < 200.0),
        "height 200-400": conditions[:, 0] >= 200.0,
        "relief < 15": conditions[:, 1] < 15.0,
        "relief 15-40": (conditions[:, 1] >= 15.0) & (conditions[:, 1] < 40.0),
        "relief > 40": conditions[:, 1] >= 40.0,
        "tilt < 10": conditions[:, 2] < np.deg2rad(10.0),
        "tilt > 10": conditions[:, 2] >= np.deg2rad(10.0),
    }
    for of in names:
        errors, sds = (np.concatenate([np.array(column) for column in columns]) for columns in _columns(flights, of))
        for title, which in groups.items():
            inside = which & np.isfinite(errors)
            if inside.any():
                e, sd = errors[inside], sds[inside]
                yield (
                    f"    {of:<12} {title:<15} n {len(e):>4}  bias {e.mean():>+7.2f}  sd {e.std():>6.2f}  stated "
                    f"{np.sqrt(np.mean(sd**2)):>6.2f}  rms z {np.sqrt(np.mean((e / sd) ** 2)):>5.2f}  "
                    f"|z|<1 {np.mean(np.abs(e / sd) < 1.0):>4.0%}  |z|<2 {np.mean(np.abs(e / sd) < 2.0):>4.0%}"
                )


def _columns(flights: list[Samples], name: str) -> tuple[list[list[float]], list[list[float]]]:
    return [f.errors[name] for f in flights], [f.sds[name] for f in flights]
