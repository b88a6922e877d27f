"""Definitions for the flags of faults: topics, expected and allowed flags, response times of the daemon."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fti.hil.oracle.roles import AircraftRoles, TruthSeries

HEIGHT, SOLUTION, INTEGRITY = "/nav/height_above_ground", "/nav/nav_solution", "/nav/clearance_integrity"
NAV_EVENT, GROUND_DRIFT = "/fti/event/nav", "/nav/ground_drift"
DEVICES, LINKS, LEDGER = "/fti/health/devices", "/fti/health/links", "/fti/ledger"
#: Latency from a cause to an output of navigation: device, tick, output at 25 Hz [s].
NAV_S = 0.3
#: Latency of health [s]: navigation and supervisor evaluate it at 2 Hz, and it is recorded at 1 Hz.
HEALTH_S = 2.5
#: Health [s]: timeout of silence; window for rates and shared links; time until a wrong clock is flagged.
SILENT_S, WINDOW_S, CLOCK_AWAY_S = 1.0, 4.0, 2.0
#: Latency of the ledger [s]: an adapter is polled at 1 Hz and keeps its flags until then; a row is written at 1 Hz.
LEDGER_S = 2.5
#: A ledger flag is a counter that increased since the last row; it clears with the next row [s].
LEDGER_CLEARS_S = LEDGER_S + 1.0
#: A power unit reports every breaker at 2 Hz [s].
UNIT_S = 1.0
#: Time to estimate a device clock again after it was set [s].
CLOCK_RELEARN_S = 14.0
#: A clock error that lasts longer is learned as the offset of the clock [s].
CLOCK_LEARN_S = 9.0
#: Smallest detectable clock error [s]: the usual latency variation.
MIN_CLOCK_ERROR_S = 0.1
#: Integrity monitor: minimum ground speed, for the duration of a window [m/s]; time to confirm an alarm [s].
MIN_SPEED_MPS, CONFIRM_S = 35.0, 2.0
#: Time after a fault in which the filter may exclude an altimeter, or readmit it [s]: two exclusions because its
#: estimated error is not valid any more (5 s), and 30 s of agreement.
EXCLUSION_S = 45.0
#: Time after a fault in which its height may be invalid as excluded [s]: the filter uses no height that is rejected for
#: its changes, so the agreement starts after them.
HEIGHT_EXCLUSION_S = EXCLUSION_S + 14.0
#: Minimum height of an obstacle that is flagged [m]: more than any relief within the tolerance of the reference.
OBSTACLE_M = 30.0
#: Reasons from the comparison of a height with known terrain; smallest error that is certainly flagged [m].
GROUND_WORDS = ("deviation", "dispersion", "incidence", "not_nadir", "change_mismatch")
DEVIATION_M = 30.0
#: A position step [m] or drift [m/s] of this size contradicts a tactical-grade inertial unit within this time [s].
#: After a step back, the receiver is readmitted within this time [s] if the step is larger than CLOSURE_M, which the
#: filter does not drift in a minute [m].
CONTRADICTION_M, CONTRADICTION_MPS, CONTRADICTION_S = 50.0, 2.0, 15.0
READMISSION_S, CLOSURE_M = 40.0, 200.0
#: A position source that failed its own tests is rejected for this time after the fault [s]: all tests must pass for
#: 30 s, plus their window.
SOURCE_REFUSAL_S = 45.0
#: Probation of receivers that return after a long absence [s]: protection levels are those of the filter without them,
#: which may be too large for the integrity monitor.
TRIAL_S = 30.0
UNCERTAIN_WORDS = ("position_uncertain", "protection_level")
#: Reasons from the history of altimeters: of one, and of two compared with each other.
MEMORY_WORDS, DISAGREE_WORDS = ("stuck", "change_mismatch", "altimeters_disagree"), ("altimeters_disagree",)
#: A constant value is stuck if the range changes by more than 4 steps of any altimeter, as a share of the range plus a
#: constant [m], sigmas included; it is flagged within this time [s].
STUCK_SHARE, STUCK_M, STUCK_S = 0.2, 10.0, 3.0
#: Time after a cause in which the history may flag it [s]: its window, and the agreement that ends a rejection.
MEMORY_S = 14.0
#: Share of duplicated messages that exceeds the rate tolerance of health.
RATE_SHARE = 0.5
#: Number of wrong bits from which a damaged message is certainly rejected.
MIN_WRONG_BITS = 20.0


def monitor_recovery_s(craft: AircraftRoles) -> float:
    """Time after a cause in which the integrity monitor may flag it [s]: its window, and a clean window after it."""
    return 2 * craft.window_m / MIN_SPEED_MPS + CONFIRM_S


@dataclass(frozen=True, slots=True)
class ExpectedFlag:
    """A flag that must be raised: one of ``words`` at ``place`` within ``within_s`` of ``from_s``.

    until_s, clears_s : it must have cleared within clears_s of until_s
    needs_ports       : it needs real ports
    clock             : expected only while the clock of this device is known; "" : always
    value             : in place of a word, this number within 10 % at a channel (topic and field); later values are not
                        checked
    """

    place: str
    words: tuple[str, ...]
    from_s: float
    until_s: float
    within_s: float
    clears_s: float
    needs_ports: bool = False
    clock: str = ""
    value: float | None = None

    @property
    def is_due(self) -> bool:
        """Does the cause last longer than the deadline?"""
        return self.until_s - self.from_s > self.within_s


@dataclass(frozen=True, slots=True)
class FlagAllowance:
    """Flags that are allowed from from_s until until_s.

    place : topic of the flags or a parent ("/nav/x" is a parent of "/nav/x/y" and not of "/nav/xy"); "": all topics
    words : allowed words; none: any
    """

    place: str
    from_s: float
    until_s: float
    words: tuple[str, ...] = ()

    def explains(self, place: str, word: str) -> bool:
        """Is this word allowed at this place?"""
        parent = self.place.rstrip("/")
        return (place == parent or place.startswith(f"{parent}/")) and (not self.words or word in self.words)


@dataclass(frozen=True, slots=True)
class FaultFlags:
    """Expected and allowed flags of one fault on one subject (a device, a link, "flight").

    unknown   : why no flag is expected; "" if every effect is known
    too_short : flags that are not expected because the fault ends before their deadline
    """

    subject: str
    expected_flags: tuple[ExpectedFlag, ...]
    allowances: tuple[FlagAllowance, ...]
    unknown: str = ""
    too_short: tuple[ExpectedFlag, ...] = ()

    @classmethod
    def from_flags(
        cls,
        subject: str,
        expected_flags: Sequence[ExpectedFlag],
        allowances: Sequence[FlagAllowance],
        unknown: str = "",
    ) -> FaultFlags:
        """Separate the flags that are due from those whose cause is too short."""
        due = tuple(flag for flag in expected_flags if flag.is_due)
        return cls(subject, due, tuple(allowances), unknown, tuple(flag for flag in expected_flags if not flag.is_due))


#: Expected flags of a fault; why there are none.
RuleResult = tuple[Sequence[ExpectedFlag], str]


@dataclass(frozen=True, slots=True)
class FaultCase:
    """One fault on one device."""

    craft: AircraftRoles
    truth: TruthSeries
    name: str
    from_s: float
    until_s: float

    def expected_flag(
        self, place: str, *words: str, within_s: float, clears_s: float, needs_ports: bool = False
    ) -> ExpectedFlag:
        """A flag of this interval."""
        return ExpectedFlag(place, words, self.from_s, self.until_s, within_s, clears_s, needs_ports)

    @property
    def health(self) -> str:
        """Topic of the health of the device."""
        return f"{DEVICES}/{self.name}"
