"""Height when satellites are gone: an inertial vertical channel, held by an altimeter over known ground.

Live form of the filter of ``fti.nav.vertical.kalman_filter``.  Three aidings, each a row of five (h, times the delay of the
measurement in the climb's place, because the error was another one when it was true):

    satellites   z = alt_I - alt          h = (1 -tau 0 0  0)    primes the channel while there are any
    climb        z = climb_I - climb      h = (0    1 0 0  0)    theirs, too
    altimeter    z = alt_I - (height_agl + ground)    h = (1 -tau 0 0 -1)

The errors of satellites' heights hang together for minutes: a height every dt counts with the variance sigma^2 2 T/dt,
so that many say no more than a few.  The altimeter's has a state.  What its ground may be wrong by lasts as long (an
elevation model errs over hundreds of metres, a place is wrong for minutes): it makes that state larger, not the noise.
What the filter finds is subtracted from the channel's output only, as the source does it (feed forward); when it
becomes larger than ``FOLD_M`` it is taken out of the channel, which changes no output, because everything is linear.

Fallbacks: no aiding: the channel alone, with the sigma that it has then; not valid beyond ``max_sd``.  No inertial
samples for ``MAX_GAP_S``, or another time base: the channel ends, and begins anew with the next height of satellites (or
where there are none, of the altimeter over known ground).  A beginning is confirmed by the next ``MIN_CONFIRMATIONS``
measurements; the first that is refused before, and the channel begins again: the one it began with was wrong, or this
one.  The altimeter refused for ``lockout_s`` with nothing else
taken: see ``filter``; not valid until it is trusted again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from fti.nav.time_series import SECOND_NS
from fti.nav.vertical.error_model import ALTIMETER, CLIMB, HEIGHT, STATES, VerticalModel
from fti.nav.vertical.inertial_height import HorizontalMotion, InertialHeight, Vector, vertical_acceleration
from fti.nav.vertical.kalman_filter import GATE, ErrorFilter, Innovation
from fti.types import Reason

#: An error this large is taken out of the channel [m].
FOLD_M = 100.0
#: Longest time between two inertial samples [s]; a measurement that is older, or ahead, is not used.
MAX_GAP_S = 0.5
MAX_LATENESS_S = 1.0
#: So many measurements after the first confirm a beginning.
MIN_CONFIRMATIONS = 2
#: One sigma of a climb that nobody told [m/s], of a sigma that nobody told [m].
CLIMB_SD_UNKNOWN, SD_UNKNOWN = 10.0, 10.0
#: No height or sigma [m], climb or speed [m/s], specific force [m/s^2] of a flight is larger.
MAX_LENGTH_M, MAX_SPEED_MPS, MAX_FORCE_MPS2 = 1e6, 1e4, 1e3
#: A greater change from one sample to the next [m/s^2] may be no motion, as in ``filter.kernels``: gusts and stick
#: change a tenth of it in 10 ms.  Who vibrates more loses certainty, not the height.
SHOCK = 30.0
#: A sigma that is smaller [m, m/s] is none.
MIN_SD = 1e-3
#: So long after its last measurement an aiding is still named [s].
TIMEOUT_AIDING_S = 2.0


class HeightAiding(StrEnum):
    """What holds the height."""

    SATELLITES = "satellites"
    ALTIMETER = "altimeter"
    NONE = "none"  # the inertial channel alone


@dataclass(frozen=True, slots=True)
class VerticalSettings:
    """How the fallback judges.

    gate, lockout_s : of ``filter``
    satellite_tau_s : for so long errors of satellites' heights hang together [s];  climb_tau_s : of their climb
    most_sd         : a height with a larger sigma is not valid [m]
    """

    model: VerticalModel = field(default_factory=VerticalModel)
    gate: float = GATE
    lockout_s: float = 10.0
    satellite_tau_s: float = 150.0
    climb_tau_s: float = 5.0
    max_sd: float = 50.0


@dataclass(frozen=True, slots=True)
class VerticalState:
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
    """Takes what comes, in any order of time, and says the height at any time near the newest inertial sample."""

    def __init__(self, settings: VerticalSettings | None = None) -> None:
        self._settings = settings or VerticalSettings()
        self._channel: InertialHeight | None = None
        self._filter: ErrorFilter | None = None
        self._filter_ns = 0
        self._imu_ns: int | None = None
        self._last_ns: dict[str, int] = {}
        self._confirmations = 0
        self._altimeter_refused = False
        self._ground_sd = 0.0

    # ----------------------------------------------------------------------------------------------------- taking

    def feed_imu(self, t_ns: int, accel_b: Vector, roll: float, pitch: float, place: HorizontalMotion) -> None:
        """A sample of specific force [m/s^2] with the attitude [rad] and place at its time.

        One that is not newer than the last, or has no number somewhere, is passed over; after a gap the channel ends.
        """
        within = max(map(abs, accel_b)) < MAX_FORCE_MPS2 and max(abs(place.north), abs(place.east)) < MAX_SPEED_MPS
        if not within or not all(map(math.isfinite, (*accel_b, roll, pitch, place.lat, place.north, place.east))):
            return
        if self._imu_ns is not None and t_ns <= self._imu_ns:
            if self._imu_ns - t_ns > MAX_LATENESS_S * SECOND_NS:  # another time base
                self._end(t_ns)
            return
        if self._imu_ns is not None and t_ns - self._imu_ns > MAX_GAP_S * SECOND_NS:
            self._end(t_ns)
        self._imu_ns = t_ns
        if self._channel is not None and t_ns > self._channel.t_ns:
            accel = vertical_acceleration(accel_b, roll, pitch, place, self._channel.alt)
            self._add_shock_noise(accel, (t_ns - self._channel.t_ns) / SECOND_NS)
            self._channel.advance(t_ns, accel)

    def _add_shock_noise(self, accel: float, dt: float) -> None:
        """A jump of what is felt makes the climb as uncertain as it would be wrong, if nobody flew it."""
        assert self._channel is not None and self._filter is not None
        before = self._channel.accel
        jumped = 0.0 if before is None else abs(accel - before) - SHOCK
        if jumped > 0.0:
            self._filter.P[CLIMB, CLIMB] += (jumped * dt) ** 2

    def feed_satellites(
        self, t_ns: int, alt: float, sd: float | None, climb: float | None, climb_sd: float | None
    ) -> None:
        """Height above the ellipsoid [m] and climb [m/s] of P by satellites, true at t_ns, and their sigmas."""
        if not abs(alt) < MAX_LENGTH_M:
            return
        sd = _usable_sd(sd, SD_UNKNOWN)
        told = climb is not None and abs(climb) < MAX_SPEED_MPS
        if self._channel is None:
            self._begin(t_ns, alt, sd, climb if told else None, climb_sd)
            return
        weight = self._weight("satellites", t_ns, self._settings.satellite_tau_s)
        self._take("satellites", t_ns, alt, sd**2 * weight, _row(HEIGHT))
        if told and climb is not None and self._channel is not None:
            weight = self._weight("climb", t_ns, self._settings.climb_tau_s)
            self._take("climb", t_ns, climb, _usable_sd(climb_sd, CLIMB_SD_UNKNOWN) ** 2 * weight, _row(CLIMB))

    def feed_height(self, t_ns: int, height_agl: float, sd: float | None, ground: float, ground_sd: float) -> None:
        """Height of P above ground [m] by an altimeter, true at t_ns, and the ground's above the ellipsoid [m]."""
        if not abs(height_agl) + abs(ground) + abs(ground_sd) < MAX_LENGTH_M:
            return
        noise, alt = _usable_sd(sd, SD_UNKNOWN), height_agl + ground
        if self._channel is None:
            own = math.hypot(self._settings.model.altimeter_sd, ground_sd)
            self._begin(t_ns, alt, math.hypot(noise, own), None, None)
            if self._filter is not None:  # what the altimeter has too much the channel has, too
                self._filter.P[[HEIGHT, ALTIMETER, ALTIMETER], [ALTIMETER, HEIGHT, ALTIMETER]] = own**2
                self._ground_sd = ground_sd
            return
        self._resize(abs(ground_sd))
        self._take("altimeter", t_ns, alt, noise**2, _row(HEIGHT, ALTIMETER))

    # ------------------------------------------------------------------------------------------------------ telling

    @property
    def altimeter_refused(self) -> bool:
        """Whether the newest height of the altimeter was outside the confidence region."""
        return self._altimeter_refused

    def last_accepted_ns(self, aiding: HeightAiding) -> int | None:
        """When a height of this aiding was taken last; None: never."""
        return self._last_ns.get(f"taken {aiding}")

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
        ahead = (t_ns - self._channel.t_ns) / SECOND_NS
        reasons = self._reasons(float(sd[HEIGHT]))
        return VerticalState(
            t_ns,
            alt=alt - float(x[HEIGHT] + ahead * x[CLIMB]),
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
        return tuple(reason for reason, so in table if so)

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
        ahead_s = (self._imu_ns - t_ns) / SECOND_NS
        rate_sd = CLIMB_SD_UNKNOWN if climb is None else _usable_sd(climb_sd, CLIMB_SD_UNKNOWN)
        self._channel = InertialHeight(self._imu_ns, alt + (climb or 0.0) * ahead_s, climb or 0.0)
        P = self._settings.model.start(math.hypot(sd, rate_sd * ahead_s), rate_sd)
        self._filter = ErrorFilter(np.zeros(STATES), P, self._settings.gate, self._settings.lockout_s)
        self._filter_ns = self._imu_ns
        self._confirmations, self._ground_sd = 0, 0.0

    def _end(self, t_ns: int) -> None:
        self._channel = self._filter = None
        self._imu_ns, self._altimeter_refused = t_ns, False
        self._last_ns.clear()

    def _weight(self, aiding: str, t_ns: int, tau_s: float) -> float:
        """How many times its variance a measurement counts, whose error hangs together with the last one's."""
        last = self._last_ns.get(aiding)
        if last is None or t_ns <= last:
            return max(1.0, 2.0 * tau_s)
        return max(1.0, 2.0 * tau_s * SECOND_NS / (t_ns - last))

    def _take(self, aiding: str, t_ns: int, value: float, variance: float, h: np.ndarray) -> None:
        """Channel minus measurement, at the time of the measurement, against the errors of now."""
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
        found = self._filter.update((climb if of_climb else alt) - value, h, variance)
        self._note(aiding, t_ns, found)

    def _note(self, aiding: str, t_ns: int, found: Innovation) -> None:
        assert self._channel is not None and self._filter is not None
        if aiding == HeightAiding.ALTIMETER:
            self._altimeter_refused = not bool(found.accepted)
        if bool(found.accepted):
            self._last_ns[f"taken {aiding}"] = t_ns
            self._confirmations += 1
        elif self._confirmations < MIN_CONFIRMATIONS:
            self._channel = self._filter = None
            return
        if abs(self._filter.x[HEIGHT]) > FOLD_M:
            self._channel.shift(*map(float, self._filter.x[[HEIGHT, CLIMB]]))
            self._filter.x[[HEIGHT, CLIMB]] = 0.0

    def _resize(self, ground_sd: float) -> None:
        """The altimeter's error where its ground is wrong by more, or less, than that before.

        Of two errors, one ``share`` times the other, the larger one holds the smaller: so much of what was found stays,
        and the rest of the new variance is unknown.
        """
        assert self._filter is not None
        self._propagate()
        own = self._settings.model.altimeter_sd
        before, now = math.hypot(own, self._ground_sd), math.hypot(own, ground_sd)
        share, P = min(before, now) / max(before, now), self._filter.P
        self._ground_sd = ground_sd
        if now < before:
            self._filter.x[ALTIMETER] *= share
            P[ALTIMETER] *= share
            P[:, ALTIMETER] *= share
        P[ALTIMETER, ALTIMETER] += max(0.0, min((1.0 - share**2) * now**2, now**2 - P[ALTIMETER, ALTIMETER]))

    def _propagate(self) -> None:
        """The filter to the newest inertial sample."""
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
