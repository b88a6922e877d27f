"""JSBSim in SI units: initial conditions, controls and state.

Source: JSBSim 1.3 (Berndt 2004); its turbulence is that of MIL-F-8785C, seeded.  Signs are JSBSim's for commands
(elevator and rudder: a positive elevator lowers the nose) and those of ``fti.drivers.deflection_pickups`` in samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from fti.constants import FOOT
from fti.errors import MissingError
from fti.geodesy.atmosphere import ISA_TEMPERATURE, Atmosphere
from fti.hil.flight.jsbsim.airframe import INCH, Airframe

PASCAL_PER_PSF = 47.880258980
RANKINE = 1.8
#: Integration steps of JSBSim, and number of steps per control command.
STEPS_PER_SECOND, STEPS = 100, 2
#: Period of the autopilot and of the samples [s].
PERIOD_S = STEPS / STEPS_PER_SECOND
#: Turbulence intensities of MIL-F-8785C: wind 20 ft above the ground [m/s] for low heights, and the number of the
#: exceedance curve for heights above 2000 ft.
MILSPEC = 3
INTENSITIES = {"light": (15.0 * 0.514444, 3), "moderate": (30.0 * 0.514444, 4), "severe": (45.0 * 0.514444, 6)}

#: Logged quantities of a flight, with their JSBSim properties.
COLUMNS = {
    "x": "position/ecef-x-ft",
    "y": "position/ecef-y-ft",
    "z": "position/ecef-z-ft",
    "cg_x": "inertia/cg-x-in",
    "cg_y": "inertia/cg-y-in",
    "cg_z": "inertia/cg-z-in",
    "roll": "attitude/phi-rad",
    "pitch": "attitude/theta-rad",
    "heading": "attitude/psi-rad",
    "vel_north": "velocities/v-north-fps",
    "vel_east": "velocities/v-east-fps",
    "vel_down": "velocities/v-down-fps",
    "p": "velocities/p-rad_sec",
    "q": "velocities/q-rad_sec",
    "r": "velocities/r-rad_sec",
    "force_x": "accelerations/Nx",
    "force_y": "accelerations/Ny",
    "force_z": "accelerations/Nz",
    "tas": "velocities/vt-fps",
    "cas": "velocities/vc-fps",
    "aoa": "aero/alpha-rad",
    "slip": "aero/beta-rad",
    "pressure": "atmosphere/P-psf",
    "temperature": "atmosphere/T-R",
    "wind_north": "atmosphere/total-wind-north-fps",
    "wind_east": "atmosphere/total-wind-east-fps",
    "wind_down": "atmosphere/total-wind-down-fps",
    "left_aileron": "fcs/left-aileron-pos-rad",
    "right_aileron": "fcs/right-aileron-pos-rad",
    "elevator": "fcs/elevator-pos-rad",
    "rudder": "fcs/rudder-pos-rad",
    "flaps": "fcs/flap-pos-deg",
    "throttle": "fcs/throttle-pos-norm",
    "on_ground": "gear/wow",
}
_LOGGED_PROPERTIES = tuple(COLUMNS.values())
#: The values of COLUMNS at one instant.
Row = tuple[float, ...]


def package() -> ModuleType:
    """The package ``jsbsim``, with its log messages disabled.  Raises MissingError when it is not installed."""
    try:
        import jsbsim  # noqa: PLC0415 - an extra
    except ImportError:
        raise MissingError('flights with kind = "jsbsim" need JSBSim: pip install "fti[jsbsim]"') from None
    jsbsim.set_logger(jsbsim.DefaultLogger(jsbsim.LogLevel.FATAL))
    module: ModuleType = jsbsim
    return module


@dataclass(frozen=True, slots=True)
class InitialConditions:
    """Initial state of the model: lat, lon, heading [rad], alt [m above the ellipsoid], true airspeed [m/s]."""

    lat: float
    lon: float
    alt: float
    heading: float
    tas: float


@dataclass(frozen=True, slots=True)
class Weather:
    """The air: velocity north, east [m/s], pressure and temperature; turbulence intensity, or "none"."""

    wind_n: tuple[float, float]
    atmosphere: Atmosphere
    undulation: float
    turbulence: str
    seed: int


@dataclass(slots=True)
class Controls:
    """Commands: -1 to 1 (aileron right, elevator nose down, rudder left), 0 to 1 (the others; brakes left, right)."""

    aileron: float = 0.0
    elevator: float = 0.0
    rudder: float = 0.0
    throttle: float = 0.5
    flaps: float = 0.0
    gear: float = 1.0
    brakes: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class AircraftState:
    """Input of the autopilot; SI, radians, n axes; alt of P above the ellipsoid; ``pitch_rate`` is that of theta."""

    position_e: tuple[float, float, float]
    alt: float
    vel_n: tuple[float, float, float]
    cas: float
    tas: float
    roll: float
    pitch: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float
    aoa: float
    slip: float
    on_ground: bool


class Fdm:
    """One aircraft in the air."""

    def __init__(self, airframe: Airframe, start: InitialConditions, weather: Weather, ground: float) -> None:
        self._airframe = airframe
        self._model: Any = package().FGFDMExec(None)
        self._model.set_debug_level(0)
        if not self._model.load_model(airframe.model):
            raise MissingError(f"JSBSim has no aircraft {airframe.model!r}")
        self._model.set_dt(1.0 / STEPS_PER_SECOND)
        self._begin(start, ground)
        self._set_air(weather)
        for engine in range(airframe.engines):
            self._model[f"fcs/mixture-cmd-norm[{engine}]"] = 1.0
            self._model[f"fcs/advance-cmd-norm[{engine}]"] = 1.0
        self._model["propulsion/magneto_cmd"] = 3
        self._model["propulsion/starter_cmd"] = 1

    def _begin(self, start: InitialConditions, ground: float) -> None:
        model = self._model
        model["ic/lat-geod-deg"], model["ic/long-gc-deg"] = math.degrees(start.lat), math.degrees(start.lon)
        model["ic/terrain-elevation-ft"] = ground / FOOT
        model["ic/h-sl-ft"] = start.alt / FOOT
        model["ic/vt-fps"] = start.tas / FOOT
        model["ic/psi-true-rad"] = start.heading
        model["ic/alpha-rad"] = self._airframe.trim_aoa
        model["ic/gamma-rad"] = 0.0
        model.run_ic()

    def _set_air(self, weather: Weather) -> None:
        """Set pressure, temperature, wind and turbulence.

        JSBSim's sea level is the ellipsoid, ``-undulation`` above mean sea level.  Its temperature offset is relative
        to the standard temperature of the height, that of ``Atmosphere`` to the standard temperature of the pressure.
        """
        model, air, level = self._model, weather.atmosphere, -weather.undulation
        model["atmosphere/delta-T"] = (float(air.temperature(level)) - ISA_TEMPERATURE) * RANKINE
        model["atmosphere/P-sl-psf"] = float(air.p_static(level)) / PASCAL_PER_PSF
        model["atmosphere/wind-north-fps"], model["atmosphere/wind-east-fps"] = (w / FOOT for w in weather.wind_n)
        if weather.turbulence in INTENSITIES:
            wind, curve = INTENSITIES[weather.turbulence]
            model["simulation/randomseed"] = weather.seed
            model["atmosphere/randomseed"] = weather.seed
            model["atmosphere/turb-type"] = MILSPEC
            model["atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps"] = wind / FOOT
            model["atmosphere/turbulence/milspec/severity"] = curve

    def set_ground(self, alt: float) -> None:
        """Set the height of the ground below [m above the ellipsoid], for ground effect and turbulence."""
        self._model["position/terrain-elevation-asl-ft"] = alt / FOOT

    def step(self, controls: Controls) -> None:
        """Hold the controls for PERIOD_S."""
        model = self._model
        model["fcs/aileron-cmd-norm"] = controls.aileron
        model["fcs/elevator-cmd-norm"] = controls.elevator
        model["fcs/rudder-cmd-norm"] = controls.rudder
        model["fcs/flap-cmd-norm"], model["gear/gear-cmd-norm"] = controls.flaps, controls.gear
        for engine in range(self._airframe.engines):
            model[f"fcs/throttle-cmd-norm[{engine}]"] = controls.throttle
        model["fcs/left-brake-cmd-norm"], model["fcs/right-brake-cmd-norm"] = controls.brakes
        for _ in range(STEPS):
            model.run()

    def sense(self) -> AircraftState:
        """The current state."""
        model = self._model
        roll, pitch = model["attitude/phi-rad"], model["attitude/theta-rad"]
        below = self._airframe.reference[2] - model["inertia/cg-z-in"] * INCH
        return AircraftState(
            position_e=tuple(model[f"position/ecef-{axis}-ft"] * FOOT for axis in "xyz"),
            alt=model["position/geod-alt-ft"] * FOOT + below * math.cos(roll) * math.cos(pitch),
            vel_n=tuple(model[f"velocities/v-{axis}-fps"] * FOOT for axis in ("north", "east", "down")),
            cas=model["velocities/vc-fps"] * FOOT,
            tas=model["velocities/vt-fps"] * FOOT,
            roll=roll,
            pitch=pitch,
            roll_rate=model["velocities/p-rad_sec"],
            pitch_rate=model["velocities/thetadot-rad_sec"],
            yaw_rate=model["velocities/r-rad_sec"],
            aoa=model["aero/alpha-rad"],
            slip=model["aero/beta-rad"],
            on_ground=model["gear/wow"] > 0.0,
        )

    def row(self) -> Row:
        """The current values of COLUMNS, in JSBSim's units."""
        model = self._model
        return tuple([model[name] for name in _LOGGED_PROPERTIES])
