"""The autopilot: from a track and a height to the controls, in cascaded loops with limits.

    lateral     bank from the turn to a point ahead on the track:  a = 2 V^2 / L sin(eta),  L = V LOOKAHEAD_S
                (Park, Deyst and How 2004); then aileron from the bank error, rudder as yaw damper
    vertical    climb from the height error and the slope of the route, limited, and reduced at low airspeed; pitch from
                climb and angle of attack; elevator from the pitch error
    speed       throttle from the airspeed error and from the climb

Integrators are limited (anti-windup).  Deflections are scaled by the dynamic pressure relative to ``trim_speed``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fti.constants import STANDARD_GRAVITY
from fti.hil.flight.jsbsim.airframe import Airframe
from fti.hil.flight.jsbsim.fdm import AircraftState, Controls

BANK_LIMIT = math.radians(30.0)
PITCH_LIMITS = math.radians(-12.0), math.radians(15.0)
#: Climb rate per height error [1/s], limits of the climb rate [m/s], and of its change [m/s^2].
HEIGHT_GAIN = 0.25
CLIMB_LIMITS = -7.0, 9.0
CLIMB_CHANGE = 2.0
#: Reduction of the climb rate per airspeed deficit [1].
SPEED_DEFICIT_GAIN = 1.0
#: Pitch per error of the climb angle, and per error and second [1, 1/s]; time constant of the angle of attack [s].
PATH_GAIN, PATH_SUM = 1.0, 0.25
AOA_S = 8.0
#: On the ground: steering per side acceleration [1/(m/s^2)], and brake command.
STEER, BRAKES = 0.12, 0.3


@dataclass(frozen=True, slots=True)
class GuidanceCommand:
    """Commands of the route: side acceleration [m/s^2, right], height above the commanded one [m], slope of the route
    as climb rate [m/s], calibrated airspeed [m/s]."""

    side: float
    height_error: float
    climb: float
    cas: float


class Autopilot:
    """One aircraft's autopilot, called every ``period`` [s]."""

    def __init__(self, airframe: Airframe, period: float) -> None:
        self._airframe, self._gains, self._period = airframe, airframe.gains, period
        self._aoa = airframe.trim_aoa
        self._climb = 0.0
        self._pitch_sum = self._path_sum = self._bank_sum = 0.0
        self._throttle_sum = airframe.cruise_throttle

    def step(self, now: AircraftState, command: GuidanceCommand) -> Controls:
        """The commands of the axes; the route sets flaps and gear."""
        if now.on_ground:
            return self._rolling(now, command.side)
        climb = self._climb_command(now, command)
        softness = min((self._airframe.trim_speed / max(now.tas, 20.0)) ** 2, 3.0)
        aileron, rudder = self._lateral(now, command.side)
        return Controls(
            aileron=_clip(aileron * softness, -1.0, 1.0),
            elevator=self._elevator(now, self._pitch_command(now, climb), softness),
            rudder=_clip(rudder * softness, -1.0, 1.0),
            throttle=self._throttle(now, command.cas, climb),
        )

    def _rolling(self, now: AircraftState, side: float) -> Controls:
        """On the runway: idle power, brakes, steering along the track with rudder and differential braking."""
        steer = _clip(STEER * side - self._gains.yaw_rate * now.yaw_rate, -1.0, 1.0)
        brakes = (max(BRAKES - steer, 0.0), max(BRAKES + steer, 0.0))
        return Controls(rudder=-steer, throttle=0.0, brakes=brakes)

    def _climb_command(self, now: AircraftState, command: GuidanceCommand) -> float:
        target = _clip(command.climb - HEIGHT_GAIN * command.height_error, *CLIMB_LIMITS)
        target -= SPEED_DEFICIT_GAIN * max(command.cas - 2.0 - now.cas, 0.0)
        change = CLIMB_CHANGE * self._period
        self._climb = _clip(target, self._climb - change, self._climb + change)
        return self._climb

    def _pitch_command(self, now: AircraftState, climb: float) -> float:
        speed = max(math.hypot(*now.vel_n), 20.0)
        path = math.asin(_clip(climb / speed, -0.5, 0.5))
        error = path - math.asin(_clip(-now.vel_n[2] / speed, -0.5, 0.5))
        self._aoa += (now.aoa - self._aoa) * self._period / AOA_S
        self._path_sum = _clip(self._path_sum + PATH_SUM * error * self._period, -0.1, 0.1)
        return _clip(path + self._aoa * math.cos(now.roll) + PATH_GAIN * error + self._path_sum, *PITCH_LIMITS)

    def _elevator(self, now: AircraftState, pitch: float, softness: float) -> float:
        """Command from -1 (nose up) to 1; the travel differs up and down."""
        gains, error = self._gains, pitch - now.pitch
        self._pitch_sum = _clip(self._pitch_sum + gains.pitch_sum * error * self._period, -0.2, 0.2)
        up = softness * (gains.pitch * error + self._pitch_sum - gains.pitch_rate * now.pitch_rate)
        travel = self._airframe.elevator_up if up > 0.0 else self._airframe.elevator_down
        return _clip(-up / travel, -1.0, 1.0)

    def _lateral(self, now: AircraftState, side: float) -> tuple[float, float]:
        gains = self._gains
        bank = _clip(math.atan2(side, STANDARD_GRAVITY), -BANK_LIMIT, BANK_LIMIT)
        error = bank - now.roll
        self._bank_sum = _clip(self._bank_sum + gains.bank_sum * error * self._period, -0.2, 0.2)
        aileron = gains.bank * error + self._bank_sum - gains.bank_rate * now.roll_rate
        turn = STANDARD_GRAVITY / max(now.tas, 20.0) * math.tan(now.roll)
        return aileron, gains.yaw_rate * (now.yaw_rate - turn * math.cos(now.roll))

    def _throttle(self, now: AircraftState, cas: float, climb: float) -> float:
        gains, error = self._gains, cas - now.cas
        direct = gains.speed * error + gains.climb * climb / max(now.tas, 20.0)
        target = self._throttle_sum + direct
        if 0.0 < target < 1.0 or (target >= 1.0) == (error < 0.0):
            self._throttle_sum = _clip(self._throttle_sum + gains.speed_sum * error * self._period, 0.0, 1.0)
        return _clip(target, 0.0, 1.0)


def _clip(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)
