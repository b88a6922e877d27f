"""The terms in which flags of faults are stated: places of a session, duties, times that the daemon needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fti.hil.oracle.roles import AircraftRoles, TruthSeries

HEIGHT, SOLUTION, INTEGRITY = "/nav/height_above_ground", "/nav/nav_solution", "/nav/clearance_integrity"
NAV_EVENT = "/fti/event/nav"
DEVICES, LINKS, LEDGER = "/fti/health/devices", "/fti/health/links", "/fti/ledger"
#: From a cause to an output of navigation: latency of the device, a tick, 25 Hz [s].
NAV_S = 0.3
#: Navigation looks at its devices twice a second, the supervisor asks as often and records every second time [s].
HEALTH_S = 2.5
#: Silence that health calls so; the window over which it judges rates and shared links; when a clock is doubted [s].
SILENT_S, WINDOW_S, CLOCK_AWAY_S = 1.0, 4.0, 2.0
#: An adapter is asked once a second and holds its flags until then, the ledger is written once a second [s].
LEDGER_S = 2.5
#: What has grown in one row of the ledger has gone in the next [s].
LEDGER_CLEARS_S = LEDGER_S + 1.0
#: A power unit tells of every breaker twice a second [s].
UNIT_S = 1.0
#: A device's clock is learned anew so long after it was set [s].
CLOCK_RELEARN_S = 14.0
#: What is off for longer is taken for the clock's own from then on [s].
CLOCK_LEARN_S = 9.0
#: What a clock is off by before anybody can see it [s]: the usual lateness.
MIN_CLOCK_ERROR_S = 0.1
#: The integrity monitor judges a window; this speed is the lowest that is flown [m/s], and it confirms an alarm [s].
MIN_SPEED_MPS, CONFIRM_S = 35.0, 2.0
#: So long after a fault the filter may exclude an altimeter, or let it aid again [s]: until it is excluded because what
#: had been found of its error is not true any more, twice (5 s), and until it has agreed for 30 s.
EXCLUSION_S = 45.0
#: Its height may be refused as excluded for so long after a fault [s]: the filter takes no height that is refused for
#: its changes, and its agreement begins after them.
HEIGHT_EXCLUSION_S = EXCLUSION_S + 14.0
#: No relief that the reference leaves open is as high as this [m].
OBSTACLE_M = 30.0
#: What known ground says against a height; it tells so much of a value that stands still, too [m].
GROUND_WORDS = ("deviation", "dispersion", "incidence", "not_nadir", "change_mismatch")
DEVIATION_M = 30.0
#: A receiver that steps so far [m], or drifts so fast [m/s], contradicts an inertial unit of tactical grade within this
#: time [s].  It is back in so long after it has stepped back [s], where that is farther than so much [m], which the
#: filter has not drifted in a minute.
CONTRADICTION_M, CONTRADICTION_MPS, CONTRADICTION_S = 50.0, 2.0, 15.0
READMISSION_S, CLOSURE_M = 40.0, 200.0
#: A source of position that contradicted itself is refused for so long after the fault [s]: 30 s in which all its tests
#: pass, and what they look back.
SOURCE_REFUSAL_S = 45.0
#: Receivers that come back after a long absence are on trial for so long [s]: levels are those of the filter without
#: them, with which a place may be too uncertain for the integrity monitor.
TRIAL_S = 30.0
UNCERTAIN_WORDS = ("position_uncertain", "protection_level")
#: What the memory of altimeters says: of one, and of two against each other.
MEMORY_WORDS, DISAGREE_WORDS = ("stuck", "change_mismatch", "altimeters_disagree"), ("altimeters_disagree",)
#: A value that repeats while the range changed by more is stuck: 4 steps of any altimeter, as a share of the range and
#: beside that [m], with the sigmas; then it is said within this time [s].
STUCK_SHARE, STUCK_M, STUCK_S = 0.2, 10.0, 3.0
#: So long after a cause the memory may speak of it [s]: its window, and the agreement that ends a refusal.
MEMORY_S = 14.0
#: A share of messages that changes a rate by more than what health tolerates.
RATE_SHARE = 0.5
#: Wrong bits that are enough for a message to be refused beyond doubt.
MIN_WRONG_BITS = 20.0


def monitor_recovery_s(craft: AircraftRoles) -> float:
    """So long behind a cause the integrity monitor may speak of it [s]: it leaves the window, and a new one is calm."""
    return 2 * craft.window_m / MIN_SPEED_MPS + CONFIRM_S


@dataclass(frozen=True, slots=True)
class ExpectedFlag:
    """A flag that must be raised: one of ``words`` at ``place`` within ``within_s`` of ``from_s``.

    until_s, clears_s : it must have gone at the latest so long after until_s
    ports             : only real ports can show it
    clock             : only while the clock of this device is known; "" : always
    value             : instead of a word, this number, within a tenth, at a channel (topic and field); what stands
                        there afterwards is not judged
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
        """Does the cause last long enough?"""
        return self.until_s - self.from_s > self.within_s


@dataclass(frozen=True, slots=True)
class FlagAllowance:
    """Flags may be a consequence from from_s until until_s.

    place : of the flags, or above it ("/nav/x" is above "/nav/x/y" and not above "/nav/xy"); "" is above all
    words : these alone; none: any
    """

    place: str
    from_s: float
    until_s: float
    words: tuple[str, ...] = ()

    def explains(self, place: str, word: str) -> bool:
        """Is it a consequence that this word stands at this place?"""
        above = self.place.rstrip("/")
        return (place == above or place.startswith(f"{above}/")) and (not self.words or word in self.words)


@dataclass(frozen=True, slots=True)
class FaultFlags:
    """What belongs to one fault of one subject (a device, a link, "flight").

    unknown   : what raises no flag, in words; "" where every consequence is known
    too_short : flags that are not due because the fault ends before they must be raised
    """

    subject: str
    expected_flags: tuple[ExpectedFlag, ...]
    may: tuple[FlagAllowance, ...]
    unknown: str = ""
    too_short: tuple[ExpectedFlag, ...] = ()

    @classmethod
    def from_flags(
        cls, subject: str, expected_flags: Sequence[ExpectedFlag], may: Sequence[FlagAllowance], unknown: str = ""
    ) -> FaultFlags:
        """The same, with the duties that are due apart from those whose cause is too short."""
        due = tuple(expected_flag for expected_flag in expected_flags if expected_flag.is_due)
        return cls(
            subject,
            due,
            tuple(may),
            unknown,
            tuple(expected_flag for expected_flag in expected_flags if not expected_flag.is_due),
        )


#: What is due of a fault; and what nobody knows yet, in words.
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
        """A duty of this interval."""
        return ExpectedFlag(place, words, self.from_s, self.until_s, within_s, clears_s, needs_ports)

    @property
    def health(self) -> str:
        """Where the health of the device is told."""
        return f"{DEVICES}/{self.name}"
