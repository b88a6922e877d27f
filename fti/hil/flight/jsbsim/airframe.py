"""Aircraft data and gains of the autopilot.

The reference point P of the body frame is a point of the structure: 24 inches above the aerodynamic reference point of
JSBSim's file, 1.61 m above the wheels.  (An antenna 0.6 m below P, as in the shipped configurations, is 0.9 m above the
runway; altimeters have a minimum range.)  JSBSim integrates the centre of gravity, which is 0.49 m below P in the C310
and moves with the fuel; the vector between the two is read from JSBSim at every sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

INCH = 0.0254


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of the cascaded loops, found by trial in calm air and in gusts; angles in radians.

    pitch, pitch_rate, pitch_sum : elevator per error of pitch, per pitch rate, per error and second
    bank, bank_rate, bank_sum    : aileron (1 = full) per error of bank, per roll rate, per error and second
    yaw_rate                     : rudder (1 = full) against the yaw rate beyond that of the turn
    speed, speed_sum, climb      : throttle per error of airspeed [1/(m/s)], per error and second, per sine of climb
    """

    pitch: float
    pitch_rate: float
    pitch_sum: float
    bank: float
    bank_rate: float
    bank_sum: float
    yaw_rate: float
    speed: float
    speed_sum: float
    climb: float


@dataclass(frozen=True, slots=True)
class Airframe:
    """One aircraft of JSBSim.

    model         : its name there;  engines : how many
    reference     : P in JSBSim's structural axes (aft, right, up) [m]
    wheels        : distance of the lowest wheel below P [m]
    elevator_up, elevator_down : deflection of a full command up and down [rad]
    landing_flaps : command of the flaps on an approach, 1 : full
    trim_aoa      : approximate angle of attack at the speed ``trim_speed`` [m/s]
    climb_speed   : calibrated airspeed of a climb [m/s];  cruise_throttle : approximate throttle of level flight
    """

    model: str
    engines: int
    reference: tuple[float, float, float]
    wheels: float
    elevator_up: float
    elevator_down: float
    landing_flaps: float
    trim_aoa: float
    trim_speed: float
    climb_speed: float
    cruise_throttle: float
    gains: Gains


C310 = Airframe(
    model="c310",
    engines=2,
    reference=(46.0 * INCH, 0.0, 32.6 * INCH),
    wheels=(31.0 + 32.6) * INCH,
    elevator_up=float(np.deg2rad(14.0)),
    elevator_down=float(np.deg2rad(4.0)),
    landing_flaps=1.0 / 3.0,
    trim_aoa=float(np.deg2rad(2.0)),
    trim_speed=60.0,
    climb_speed=55.0,
    cruise_throttle=0.55,
    gains=Gains(
        pitch=0.8,
        pitch_rate=0.35,
        pitch_sum=0.4,
        bank=2.5,
        bank_rate=0.8,
        bank_sum=0.15,
        yaw_rate=0.6,
        speed=0.06,
        speed_sum=0.015,
        climb=4.0,
    ),
)

#: Airframes by their name in a scenario.
AIRFRAMES: Mapping[str, Airframe] = MappingProxyType({"c310": C310})
