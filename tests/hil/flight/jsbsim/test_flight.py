"""JSBSim with our autopilot: each route within its limits, the same twice, and the spline of it true to the model."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from fti.constants import FOOT
from fti.errors import ConfigError, MissingError
from fti.geodesy.atmosphere import Atmosphere
from fti.geodesy.gravity import transport_rate
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.flight.jsbsim import fdm
from fti.hil.flight.jsbsim.airframe import C310, INCH
from fti.hil.flight.jsbsim.fdm import PASCAL_PER_PSF, RANKINE
from fti.hil.flight.jsbsim.flight import JsbsimRun
from fti.hil.flight.trajectory import FlightState, SplineFlight
from fti.hil.sensors.inertial import specific_force_b
from tests.hil.flight.jsbsim.flights import UNDULATION, before_right, crosswind, during, hills, jsbsim_run
from tests.hil.worlds import AIRFIELD, path

STANDARD_GRAVITY = 9.80665
LANDED_S = 12.0  # of the end of an approach: flare and runway


@pytest.fixture(scope="module")
def landing() -> JsbsimRun:
    """An approach in 5 m/s of crosswind and light turbulence."""
    return jsbsim_run(crosswind(5.0), route="approach", turbulence="light", start_m=3000)


@pytest.fixture(scope="module")
def calm() -> JsbsimRun:
    """An approach in still air of another pressure and temperature."""
    return jsbsim_run(atmosphere=Atmosphere(99000.0, 12.0, 453.0), route="approach", start_m=1500)


def in_flight(flight: JsbsimRun) -> tuple[FlightState, dict[str, np.ndarray], np.ndarray]:
    """The spline at its samples, JSBSim's own figures there, and which of them are in the air."""
    t = flight.samples.t
    return SplineFlight.from_samples(flight.samples).state(t), flight.columns, (t > 0) & (t < t[-1] - LANDED_S)


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def lever_b(columns: dict[str, np.ndarray]) -> np.ndarray:
    """From the centre of gravity to P [m]."""
    cg = INCH * np.stack([columns[f"cg_{axis}"] for axis in "xyz"], axis=1)
    return np.asarray((np.array(C310.reference) - cg) * [-1.0, 1.0, -1.0])


def force_b(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Specific force at P [m/s^2], from that of the centre of gravity; JSBSim counts the third one upwards."""
    force = STANDARD_GRAVITY * np.stack([columns["force_x"], columns["force_y"], -columns["force_z"]], axis=1)
    omega, lever = np.stack([columns[axis] for axis in "pqr"], axis=1), lever_b(columns)
    turning = np.gradient(omega, columns["t"], axis=0)
    return force + np.cross(turning, lever) + np.cross(omega, np.cross(omega, lever))


def vel_n(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Velocity of P [m/s]."""
    omega = np.stack([columns[axis] for axis in "pqr"], axis=1)
    mat_nb = mat_from_rpy(columns["roll"], columns["pitch"], columns["heading"])
    of_cg = FOOT * np.stack([columns[f"vel_{axis}"] for axis in ("north", "east", "down")], axis=1)
    return np.asarray(of_cg + np.einsum("nij,nj->ni", mat_nb, np.cross(omega, lever_b(columns))))


def test_derivatives_of_the_spline_are_those_of_the_model(calm: JsbsimRun) -> None:
    """Still air: velocity within 1 mm/s, rates within 0.01 deg/s, specific force within 5 mm/s^2."""
    state, columns, there = in_flight(calm)
    omega_eb_b = np.stack([columns[axis] for axis in "pqr"], axis=1)
    mat_bn = np.swapaxes(mat_from_rpy(state.roll, state.pitch, state.heading), -1, -2)
    omega_en_b = np.einsum("nij,nj->ni", mat_bn, transport_rate(state.lat, state.alt, state.vel_n))
    assert np.abs(state.vel_n - vel_n(columns))[there].max() < 1e-3
    assert np.abs(state.omega_nb_b + omega_en_b - omega_eb_b)[there].max() < np.deg2rad(0.01)
    assert np.abs(specific_force_b(state) - force_b(columns))[there].max() < 5e-3
    assert np.abs(state.tas - FOOT * columns["tas"])[there].max() < 1e-3
    assert np.abs(state.aoa - columns["aoa"])[there].max() < np.deg2rad(0.01)


def test_turbulence_is_in_the_spline(landing: JsbsimRun) -> None:
    """Of what 50 samples a second can hold: the force of gusts is 0.9 m/s^2, what is missing of it below 0.3."""
    state, columns, there = in_flight(landing)
    force = force_b(columns)
    assert force[there, 2].std() > 0.6
    assert rms((specific_force_b(state) - force)[there]) < 0.3
    assert rms((state.vel_n - vel_n(columns))[there]) < 0.01
    assert rms(state.tas[there] - FOOT * columns["tas"][there]) < 0.02
    assert rms(state.aos[there] - columns["slip"][there]) < np.deg2rad(0.02)


def test_approach_keeps_to_the_glide_path_and_lands_on_the_runway(landing: JsbsimRun) -> None:
    """Within 10 m of the path on both sides and in height; down softly on the first half of the runway, and on it."""
    s, y = before_right(landing)
    alt, columns = landing.samples.alt, landing.columns
    established = during(landing) & (s > path().x_gpi + 50.0)
    assert np.abs(y[established]).max() < 10.0
    assert np.abs(alt - path().alt_path(s))[established].max() < 10.0
    on_ground = columns["on_ground"] > 0
    touch = int(np.argmax(on_ground))
    assert -AIRFIELD.runway_length_m / 2 < s[touch] < path().x_gpi  # on the first half of the runway
    assert columns["vel_down"][touch - 5] * FOOT < 2.0
    assert np.abs(y[on_ground]).max() < 12.0
    assert landing.duration == pytest.approx(landing.samples.t[touch], abs=0.05)


def test_the_reference_point_rolls_at_the_height_of_the_wheels(landing: JsbsimRun) -> None:
    """1.61 m with the legs unloaded; they give by 0.1 m.  The centre of gravity is 0.49 m lower."""
    rolling = landing.columns["on_ground"] > 0
    height = landing.samples.alt[rolling][-20:] - AIRFIELD.threshold_alt_m
    assert C310.wheels == pytest.approx(1.61, abs=0.01)
    assert np.all((height > C310.wheels - 0.15) & (height < C310.wheels))


def test_air_is_that_of_the_world(calm: JsbsimRun) -> None:
    """JSBSim's pressure and temperature at P are the world's within 0.3 hPa and 0.3 K: nothing contradicts a sensor."""
    air, columns = Atmosphere(99000.0, 12.0, 453.0), calm.columns
    alt_msl = calm.samples.alt - UNDULATION
    assert np.abs(columns["pressure"] * PASCAL_PER_PSF - air.p_static(alt_msl)).max() < 30.0
    assert np.abs(columns["temperature"] / RANKINE - air.temperature(alt_msl)).max() < 0.3


def test_crab_and_airspeed_show_the_wind(landing: JsbsimRun) -> None:
    """5 m/s from the left: the nose is 5 deg left of the course, and the mean of the wind is what was asked for."""
    _, columns, there = in_flight(landing)
    crab = np.rad2deg(columns["heading"][there].mean()) - AIRFIELD.course_deg
    wind = np.array([columns[f"wind_{axis}"][there].mean() * FOOT for axis in ("north", "east")])
    assert crab == pytest.approx(-np.rad2deg(np.arcsin(5.0 / 57.0)), abs=0.7)
    assert wind == pytest.approx(crosswind(5.0), abs=0.5)


def test_the_yaw_damper_damps(landing: JsbsimRun) -> None:
    """Gusts turn the nose at 1.0 deg/s (one sigma); 1.2 without the damper, 1.9 with its sign turned around."""
    _, columns, there = in_flight(landing)
    assert np.rad2deg(columns["r"][there].std()) < 1.1


def test_go_around_sinks_no_more_than_ten_metres_and_climbs() -> None:
    """From 60 m above the threshold: never below 50 m, climbing after 5 s, 250 m higher a minute later."""
    flight = jsbsim_run(crosswind(-4.0), route="go_around", turbulence="light", start_m=1500, go_around_m=60)
    height = flight.samples.alt - AIRFIELD.threshold_alt_m
    decided = int(np.argmax(height < 60.0))
    climb = -FOOT * flight.columns["vel_down"]
    assert height.min() > 50.0
    assert climb[decided + 250 : decided + 1500].min() > 0.0
    assert height[decided + 3000] > 250.0
    assert flight.columns["flaps"][-1] == 0.0


def test_pattern_closes() -> None:
    """It ends within 25 m of where it began, at the height of it; on the way it passes the runway low."""
    flight = jsbsim_run(crosswind(5.0), route="pattern", side="right", pattern_m=250, go_around_m=40)
    s, y = before_right(flight)
    height = flight.samples.alt - AIRFIELD.threshold_alt_m
    there = np.flatnonzero(during(flight))
    first, last = there[0], there[-1]
    assert np.hypot(s[last] - s[first], y[last] - y[first]) < 25.0
    assert (height[first], height[last]) == pytest.approx((250.0, 250.0), abs=5.0)
    assert y[there].max() == pytest.approx(y[first], abs=30.0)  # the circuit is right of the runway
    low = int(np.argmin(height))
    assert 30.0 < height[low] < 45.0
    assert abs(y[low]) < 10.0
    assert np.abs(np.rad2deg(flight.samples.roll[there])).max() < 40.0


def test_low_level_keeps_its_clearance() -> None:
    """Across ridges of 120 m in light turbulence: 90 % of the clearance everywhere, and not just high above it all."""
    flight = jsbsim_run(
        route="low_level",
        turbulence="light",
        speed_mps=65,
        clearance_m=100,
        via_m=((5000, 500), (2000, -500), (-2000, -500)),
        terrain=hills(),
    )
    there = during(flight)
    clearance = (flight.samples.alt - hills().height(flight.samples.lat, flight.samples.lon))[there]
    assert clearance.min() > 90.0
    assert np.ptp(flight.samples.alt[there]) > 50.0
    assert clearance.mean() < 170.0


def test_the_same_seed_gives_the_same_bits_and_another_one_other_gusts() -> None:
    def gusts(seed: int) -> bytes:
        flight = jsbsim_run(seed=seed, route="low_level", turbulence="moderate", via_m=((3000, 0), (2500, 0)))
        return flight.samples.alt.tobytes() + flight.columns["wind_down"].tobytes() + flight.samples.roll.tobytes()

    first = gusts(5)
    assert gusts(5) == first
    assert gusts(6) != first


def test_a_route_that_leaves_the_terrain_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"flight\.via_m: the route leaves the terrain 8\d\d\d m after its begin"):
        jsbsim_run(route="low_level", via_m=((2000, 0), (-7000, 0)))


def test_without_jsbsim_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jsbsim", None)
    with pytest.raises(MissingError, match=r'pip install "fti\[jsbsim\]"'):
        fdm.package()


def test_nothing_loads_jsbsim_before_a_flight() -> None:
    code = "import fti.hil.environment, sys; sys.exit('jsbsim' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
