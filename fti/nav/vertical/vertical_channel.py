"""Altitude without satellites: an inertial vertical channel, aided by an altimeter over known ground.

Live form of the filter of ``fti.nav.vertical.kalman_filter``.  There are three measurements, each with a row of five;
tau is the delay of the measurement:

    satellites   z = alt_I - alt          h = (1 -tau 0 0  0)    initialises the channel, if available
    climb        z = climb_I - climb      h = (0    1 0 0  0)    of satellites, too
    altimeter    z = alt_I - (height_agl + ground)    h = (1 -tau 0 0 -1)

Errors of satellite heights are correlated for minutes, those of their climb for seconds: a measurement every dt has the
variance sigma^2 2 T/dt, so more measurements do not add information.  With a T that is too short the climb is less
certain than stated, and the height integrates its error.  The altimeter's error is a state.  The error of the ground
elevation lasts as long (elevation models are wrong over hundreds of metres, positions for minutes): it enlarges that
state, not the noise.
The estimated error is subtracted from the channel's output only, as in the source (feed forward).  When it exceeds
``FOLD_M``, it is subtracted from the channel; this changes no output, because all equations are linear.

Without aiding, the channel continues with growing sigma, and is not valid beyond ``max_sd``.  Without inertial samples
for ``MAX_GAP_S``, or after a change of the time base, it ends; the next height of satellites (without them, of the
altimeter over known ground) starts it again.  The next ``MIN_CONFIRMATIONS`` measurements confirm the start; if one of
them is refused, the channel restarts.  If the altimeter is refused for ``lockout_s`` without any other aiding, see
``kalman_filter``: the output is not valid until the filter is trusted again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from msgspec import Struct

from fti.constants import SECOND_NS
from fti.geodesy.formulas import Vector
from fti.messages.reasons import Reason
from fti.nav.vertical.error_model import ALTIMETER, CLIMB, HEIGHT, STATES, VerticalModel
from fti.nav.vertical.inertial_height import HorizontalMotion, InertialHeight, vertical_acceleration
from fti.nav.vertical.kalman_filter import GATE, ErrorFilter, Innovation

#: A larger error is subtracted from the channel [m].
FOLD_M = 100.0
#: Longest time between two inertial samples [s]; maximum age or lead of a measurement [s].
MAX_GAP_S = 0.5
MAX_LATENESS_S = 1.0
#: Number of measurements that confirm a start.
MIN_CONFIRMATIONS = 2
#: One sigma of an unknown climb [m/s], and of a height without stated sigma [m].
CLIMB_SD_UNKNOWN, SD_UNKNOWN = 10.0, 10.0
#: Limits of plausible height and sigma [m], climb and speed [m/s], specific force [m/s^2].
MAX_LENGTH_M, MAX_SPEED_MPS, MAX_FORCE_MPS2 = 1e6, 1e4, 1e3
#: A greater change from one sample to the next [m/s^2] may be a fault, as in ``filter.kernels``: gusts and controls
#: change a tenth of it in 10 ms.  Stronger vibration increases the sigma, but does not disturb the height.
SHOCK = 30.0
#: Smaller sigmas are ignored [m, m/s].
MIN_SD = 1e-3
#: An aiding is reported for so long after its last measurement [s].
TIMEOUT_AIDING_S = 2.0


class HeightAiding(StrEnum):
    """Source that bounds the height."""

    SATELLITES = "satellites"
    ALTIMETER = "altimeter"
    NONE = "none"  # the inertial channel alone


@dataclass(frozen=True, slots=True)
class VerticalSettings:
    """Settings of the vertical channel.

    gate, lockout_s : of ``ErrorFilter``
    satellite_tau_s : correlation time of errors of satellite heights [s]; as that of the filter
    climb_tau_s     : of their climb [s]: receivers smooth over up to 20 s (assumed; a larger value is on the safe side)
    max_sd          : a height with a larger sigma is not valid [m]
    """

    model: VerticalModel = field(default_factory=VerticalModel)
    gate: float = GATE
    lockout_s: float = 10.0
    satellite_tau_s: float = 200.0
    climb_tau_s: float = 20.0
    max_sd: float = 50.0


class VerticalState(Struct, frozen=True, gc=False):
    """Height of P above the ellipsoid and climb (up), each with one sigma [m], [m/s]; None where unknown."""

    t_ns: int
    alt: float | None
    alt_sd: float | None
    climb: float | None
    climb_sd: float | None
    valid: bool
    reasons: tuple[Reason, ...]
    aiding: HeightAiding


class VerticalChannel:
    """Takes measurements in any order of time; gives the height at times near the newest inertial sample."""

    def __init__(self, settings: VerticalSettings | None = None) -> None:
        self._settings = settings or VerticalSettings()
        self._channel: InertialHeight | None = None
        self._filter: ErrorFilter | None = None
        self._filter_ns = 0
        self._imu_ns: int | None = None
        self._last_ns: dict[str, int] = {}
        self._accepted_ns: dict[str, int] = {}
        self._confirmations = 0
        self.altimeter_refused = False  # the newest height was outside the confidence region
        self._ground_sd = 0.0

    # ----------------------------------------------------------------------------------------------------------- inputs

    def feed_imu(self, t_ns: int, accel_b: Vector, roll: float, pitch: float, motion: HorizontalMotion) -> None:
        """A sample of specific force [m/s^2] with the attitude [rad] and horizontal motion at its time.

        A sample that is not newer than the last or not finite is ignored; after a gap the channel ends.
        """
        is_within = max(map(abs, accel_b)) < MAX_FORCE_MPS2 and max(abs(motion.north), abs(motion.east)) < MAX_SPEED_MPS
        if not is_within or not all(map(math.isfinite, (*accel_b, roll, pitch, motion.lat, motion.north, motion.east))):
            return
        if self._imu_ns is not None and t_ns <= self._imu_ns:
            if self._imu_ns - t_ns > MAX_LATENESS_S * SECOND_NS:  # another time base
                self._end(t_ns)
            return
        if self._imu_ns is not None and t_ns - self._imu_ns > MAX_GAP_S * SECOND_NS:
            self._end(t_ns)
        self._imu_ns = t_ns
        if self._channel is not None and t_ns > self._channel.t_ns:
            accel = vertical_acceleration(accel_b, roll, pitch, motion, self._channel.alt)
            self._add_shock_noise(accel, (t_ns - self._channel.t_ns) / SECOND_NS)
            self._channel.advance(t_ns, accel)

    def _add_shock_noise(self, accel: float, dt: float) -> None:
        """Add noise to the climb for a jump of the acceleration, which may be a fault."""
        assert self._channel is not None and self._filter is not None
        previous = self._channel.accel
        jump = 0.0 if previous is None else abs(accel - previous) - SHOCK
        if jump > 0.0:
            self._filter.P[CLIMB, CLIMB] += (jump * dt) ** 2

    def feed_satellites(
        self, t_ns: int, alt: float, sd: float | None, climb: float | None, climb_sd: float | None
    ) -> None:
        """Height above the ellipsoid [m] and climb [m/s] of P by satellites, valid at t_ns, and their sigmas."""
        if not abs(alt) < MAX_LENGTH_M:
            return
        sd = _usable_sd(sd, SD_UNKNOWN)
        has_climb = climb is not None and abs(climb) < MAX_SPEED_MPS
        if self._channel is None:
            self._begin(t_ns, alt, sd, climb if has_climb else None, climb_sd)
            return
        weight = self._weight("satellites", t_ns, self._settings.satellite_tau_s)
        self._update("satellites", t_ns, alt, sd**2 * weight, _row(HEIGHT))
        if has_climb and climb is not None and self._channel is not None:
            weight = self._weight("climb", t_ns, self._settings.climb_tau_s)
            self._update("climb", t_ns, climb, _usable_sd(climb_sd, CLIMB_SD_UNKNOWN) ** 2 * weight, _row(CLIMB))

    def feed_height(self, t_ns: int, height_agl: float, sd: float | None, ground: float, ground_sd: float) -> None:
        """Height of P above ground [m] by an altimeter, valid at t_ns, and ground elevation above the ellipsoid [m]."""
        if not abs(height_agl) + abs(ground) + abs(ground_sd) < MAX_LENGTH_M:
            return
        noise, alt = _usable_sd(sd, SD_UNKNOWN), height_agl + ground
        if self._channel is None:
            own = math.hypot(self._settings.model.altimeter_sd, ground_sd)
            self._begin(t_ns, alt, math.hypot(noise, own), None, None)
            if self._filter is not None:  # channel and altimeter have the same error
                self._filter.P[[HEIGHT, ALTIMETER, ALTIMETER], [ALTIMETER, HEIGHT, ALTIMETER]] = own**2
                self._ground_sd = ground_sd
            return
        self._resize(abs(ground_sd))
        self._update("altimeter", t_ns, alt, noise**2, _row(HEIGHT, ALTIMETER))

    # ---------------------------------------------------------------------------------------------------------- outputs

    def last_accepted_ns(self, aiding: HeightAiding) -> int | None:
        """Time of the last accepted height of this aiding; None: never."""
        return self._accepted_ns.get(aiding)

    def at(self, t_ns: int) -> VerticalState:
        """Height and climb at t_ns."""
        if self._channel is None or self._filter is None:
            reason = Reason.NO_IMU if self._imu_ns is None else Reason.ALIGNING
            return VerticalState(t_ns, None, None, None, None, valid=False, reasons=(reason,), aiding=HeightAiding.NONE)
        if abs(t_ns - self._channel.t_ns) > MAX_GAP_S * SECOND_NS:
            return VerticalState(
                t_ns, None, None, None, None, valid=False, reasons=(Reason.STALE,), aiding=HeightAiding.NONE
            )
        self._propagate()
        alt, climb = self._channel.at(t_ns)
        x, sd = self._filter.x, np.sqrt(np.diag(self._filter.P))
        lead_s = (t_ns - self._channel.t_ns) / SECOND_NS
        reasons = self._reasons(float(sd[HEIGHT]))
        return VerticalState(
            t_ns,
            alt=alt - float(x[HEIGHT] + lead_s * x[CLIMB]),
            alt_sd=float(sd[HEIGHT]),
            climb=climb - float(x[CLIMB]),
            climb_sd=float(sd[CLIMB]),
            valid=not reasons,
            reasons=reasons,
            aiding=self._aiding(t_ns),
        )

    def _reasons(self, sd: float) -> tuple[Reason, ...]:
        assert self._filter is not None
        table = (
            (Reason.ALIGNING, self._confirmations < MIN_CONFIRMATIONS),
            (Reason.REJECTED, not self._filter.is_trusted),
            (Reason.COASTING, not sd <= self._settings.max_sd),
        )
        return tuple(reason for reason, holds in table if holds)

    def _aiding(self, t_ns: int) -> HeightAiding:
        for aiding in (HeightAiding.SATELLITES, HeightAiding.ALTIMETER):
            last = self.last_accepted_ns(aiding)
            if last is not None and t_ns - last <= TIMEOUT_AIDING_S * SECOND_NS:
                return aiding
        return HeightAiding.NONE

    # ------------------------------------------------------------------------------------------------------- filter

    def _begin(self, t_ns: int, alt: float, sd: float, climb: float | None, climb_sd: float | None) -> None:
        """Begin the channel with a height, if an inertial sample is near."""
        if self._imu_ns is None or abs(t_ns - self._imu_ns) > MAX_GAP_S * SECOND_NS:
            return
        lead_s = (self._imu_ns - t_ns) / SECOND_NS
        rate_sd = CLIMB_SD_UNKNOWN if climb is None else _usable_sd(climb_sd, CLIMB_SD_UNKNOWN)
        self._channel = InertialHeight(self._imu_ns, alt + (climb or 0.0) * lead_s, climb or 0.0)
        P = self._settings.model.start(math.hypot(sd, rate_sd * lead_s), rate_sd)
        self._filter = ErrorFilter(np.zeros(STATES), P, self._settings.gate, self._settings.lockout_s)
        self._filter_ns = self._imu_ns
        self._confirmations, self._ground_sd = 0, 0.0

    def _end(self, t_ns: int) -> None:
        self._channel = self._filter = None
        self._imu_ns, self.altimeter_refused = t_ns, False
        self._last_ns.clear()
        self._accepted_ns.clear()

    def _weight(self, aiding: str, t_ns: int, tau_s: float) -> float:
        """Factor of the variance of a measurement, whose error is correlated with the last one's."""
        last = self._last_ns.get(aiding)
        if last is None or t_ns <= last:
            return max(1.0, 2.0 * tau_s)
        return max(1.0, 2.0 * tau_s * SECOND_NS / (t_ns - last))

    def _update(self, aiding: str, t_ns: int, value: float, variance: float, h: np.ndarray) -> None:
        """Update the present errors with channel minus measurement, at the time of the measurement."""
        assert self._channel is not None and self._filter is not None
        last = self._last_ns.get(aiding)
        delay_s = (self._channel.t_ns - t_ns) / SECOND_NS
        if abs(delay_s) > MAX_LATENESS_S or (last is not None and t_ns <= last):
            return
        self._last_ns[aiding] = t_ns
        self._propagate()
        alt, climb = self._channel.at(t_ns)
        of_climb = bool(h[CLIMB])
        h[CLIMB] -= delay_s * h[HEIGHT]
        innovation = self._filter.update((climb if of_climb else alt) - value, h, variance)
        self._record(aiding, t_ns, innovation)

    def _record(self, aiding: str, t_ns: int, innovation: Innovation) -> None:
        assert self._channel is not None and self._filter is not None
        if aiding == HeightAiding.ALTIMETER:
            self.altimeter_refused = not bool(innovation.accepted)
        if bool(innovation.accepted):
            self._accepted_ns[aiding] = t_ns
            self._confirmations += 1
        elif self._confirmations < MIN_CONFIRMATIONS:
            self._channel = self._filter = None
            return
        if abs(self._filter.x[HEIGHT]) > FOLD_M:
            self._channel.shift(*map(float, self._filter.x[[HEIGHT, CLIMB]]))
            self._filter.x[[HEIGHT, CLIMB]] = 0.0

    def _resize(self, ground_sd: float) -> None:
        """Adapt the altimeter's state to another sigma of the ground elevation.

        If the new sigma is smaller, estimate and covariance are scaled by ``share``; the rest of the new variance is
        independent.
        """
        assert self._filter is not None
        self._propagate()
        own = self._settings.model.altimeter_sd
        old_sd, new_sd = math.hypot(own, self._ground_sd), math.hypot(own, ground_sd)
        share, P = min(old_sd, new_sd) / max(old_sd, new_sd), self._filter.P
        self._ground_sd = ground_sd
        if new_sd < old_sd:
            self._filter.x[ALTIMETER] *= share
            P[ALTIMETER] *= share
            P[:, ALTIMETER] *= share
        P[ALTIMETER, ALTIMETER] += max(0.0, min((1.0 - share**2) * new_sd**2, new_sd**2 - P[ALTIMETER, ALTIMETER]))

    def _propagate(self) -> None:
        """Propagate the filter to the newest inertial sample."""
        assert self._channel is not None and self._filter is not None
        dt = (self._channel.t_ns - self._filter_ns) / SECOND_NS
        if dt > 0.0:
            phi, Q = self._settings.model.step(dt, self._ground_sd)
            self._filter.predict(phi, Q, dt)
            self._filter_ns = self._channel.t_ns


def _row(*states: int) -> np.ndarray:
    """h with +1 for the first state and -1 for the second."""
    h = np.zeros(STATES)
    for state, sign in zip(states, (1.0, -1.0), strict=False):
        h[state] = sign
    return h


def _usable_sd(sd: float | None, otherwise: float) -> float:
    return sd if sd is not None and MIN_SD <= sd < MAX_LENGTH_M else otherwise
