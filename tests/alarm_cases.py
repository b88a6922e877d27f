"""Every alarm of docs/alarms.md: outputs, health or events that begin its condition, and those that end it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from fti.alarms.condition import Condition, Severity
from fti.clock import FakeClock
from fti.messages.outputs import FilterMode, FilterSolution, GlideSlope, GroundDrift, IntegrityState, Output
from fti.messages.reasons import Reason
from fti.messages.tables import to_table
from fti.nav.alarm_conditions import OutputConditions
from fti.service.supervisor.alarm_board import AlarmBoard
from fti.service.supervisor.health_conditions import MIN_RESTARTS
from tests.nav.test_alarm_conditions import CONFIG, altimeter, height, integrity, solution, source
from tests.service.test_health_conditions import device, health, link

SECOND_NS = 10**9
START_S = 100.0
RUNNING: dict[str, Any] = health()["processes"]


class Daemon:
    """The alarm board and its last publication."""

    def __init__(self) -> None:
        self.clock = FakeClock(round(START_S * SECOND_NS))
        self.waiting_ns: int | None = None
        self.recorded: list[dict[str, Any]] = []
        self.conditions = OutputConditions(CONFIG)
        self.restart()
        self.publish_health()
        self.delay_navigation(0.0)

    def publish_outputs(self, *outputs: Output) -> None:
        """Outputs of navigation."""
        for report in self.conditions.feed(outputs):
            self.board.handle_report(report.as_record())

    def publish_health(self, **changes: Any) -> None:
        """A health message, 20 s after the one before."""
        self.clock.time_ns += 20 * SECOND_NS
        self.board.handle_health(health(self.clock.time_ns / SECOND_NS, **changes))

    def delay_navigation(self, late_s: float) -> None:
        """Set the waiting time of the oldest frame [s]."""
        self.waiting_ns = self.clock.time_ns - round(late_s * SECOND_NS)
        self.board.check_navigation_latency()

    def restart(self) -> None:
        """Begin another session without any data."""
        note, waiting = (lambda note: self.recorded.append(to_table(note))), (lambda: self.waiting_ns)
        self.board = AlarmBoard(self.clock, lambda topic, payload: None, note, waiting)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The alarms, as they are published."""
        return self.board._alarms.rows()


Step = Callable[[Daemon], None]


@dataclass(frozen=True)
class Case:
    """An alarm.  identity, severity, title : as published; before, begins, ends : in this order"""

    identity: str
    severity: Severity
    title: str
    begins: Step
    ends: Step | None
    before: Step = field(default=lambda daemon: None)
    is_latched: bool = True

    @property
    def is_moment(self) -> bool:
        """An alarm of a single event, which does not last."""
        return self.ends is None


def _outputs(*outputs: Output) -> Step:
    return lambda daemon: daemon.publish_outputs(*outputs)


def _health(**changes: Any) -> Step:
    return lambda daemon: daemon.publish_health(**changes)


def _processes(**changes: dict[str, Any]) -> Step:
    return _health(processes={name: RUNNING[name] | changes.get(name, {}) for name in RUNNING})


def _glide(t_s: float, valid: bool) -> GlideSlope:
    reasons = () if valid else (Reason.INTEGRITY,)
    return GlideSlope(t_ns=round(t_s * SECOND_NS), t_valid_ns=None, valid=valid, reasons=reasons)


def _filter(t_s: float, *reasons: Reason) -> FilterSolution:
    mode = FilterMode.AIDED
    return FilterSolution(t_ns=round(t_s * SECOND_NS), t_valid_ns=None, valid=True, reasons=reasons, mode=mode)


def _ground(fault: str | None) -> Step:
    return lambda daemon: daemon.board.handle_report(
        daemon.conditions.report_terrain(daemon.clock.time_ns, fault).as_record()
    )


def _use_space(daemon: Daemon) -> None:
    """1000 MB are free, and 20 MB are used in 20 s."""
    for free_mb in (1020.0, 1000.0):
        daemon.publish_health(storage={"state": "ok", "free_mb": free_mb})


def _a_minute_later(daemon: Daemon) -> None:
    daemon.clock.time_ns += 60 * SECOND_NS
    _processes(display={"restarts": MIN_RESTARTS})(daemon)


def _step_clock(daemon: Daemon) -> None:
    daemon.board.record(Condition("clock_step", Severity.CAUTION, "COMPUTER CLOCK STEPPED", "by 1 s"))


def _lose(**counts: int) -> Step:
    return _health(links=link("good", **counts))


WARNING, CAUTION, ADVISORY = Severity
OK, STATES = IntegrityState.OK, IntegrityState
#: Nothing is wrong.
WELL = _health()
NO_DEVICE: dict[str, Any] = {"position_source": "filter", "altitude_source": "filter"}
LOST: dict[str, Any] = {"valid": False, "position_source": None, "reasons": (Reason.NO_POSITION,)}
TILTED: dict[str, Any] = {
    "valid": False, "attitude_valid": False, "reasons": (Reason.ATTITUDE_LEVEL,),
    "attitude_reasons": (Reason.ATTITUDE_LEVEL,),
}  # fmt: skip
#: A single sample that deviates is no failure: the altimeter deviates for half a second.
STUCK = [altimeter(2 + 0.3 * k, "radar", Reason.STUCK) for k in range(3)]


def _of_solution(identity: str, severity: Severity, title: str, **changes: Any) -> Case:
    """A valid solution, one with changed fields, and the valid one again."""
    begins, ends, before = solution(2, **changes), solution(3), solution(1)
    return Case(identity, severity, title, _outputs(begins), _outputs(ends), _outputs(before))


def _drift(t_s: float, *reasons: Reason) -> GroundDrift:
    t_ns = round(t_s * SECOND_NS)
    return GroundDrift(t_ns=t_ns, t_valid_ns=t_ns, valid=not reasons, reasons=reasons)


def _of_monitor(identity: str, severity: Severity, title: str, state: IntegrityState, reason: Reason) -> Case:
    """Outputs of a monitor with full windows."""
    begins, ends, before = integrity(2, state, reason), integrity(3, OK), integrity(1, OK)
    return Case(identity, severity, title, _outputs(begins), _outputs(ends), _outputs(before))


#: Outputs of a restarted navigation process without data.
NOTHING: dict[str, Any] = {
    "valid": False, "position_source": None, "attitude_source": None, "altitude_source": None, "attitude_valid": False,
    "reasons": (Reason.NO_POSITION, Reason.NO_ATTITUDE), "attitude_reasons": (Reason.NO_ATTITUDE,),
}  # fmt: skip
FIRST_OUTPUTS: Sequence[Output] = (
    solution(5, **NOTHING), integrity(5, STATES.UNAVAILABLE, Reason.STALE), height(5, Reason.NO_HEIGHT),
    altimeter(5, "radar", Reason.STALE), _glide(5, valid=False), source(5, "gnss", Reason.STALE),
)  # fmt: skip

CASES: Sequence[Case] = (
    _of_monitor("integrity_alert", WARNING, "GROUND CLEARANCE ALERT", STATES.ALERT, Reason.OBSTACLE),
    _of_monitor("integrity_caution", CAUTION, "GROUND CLEARANCE CAUTION", STATES.CAUTION, Reason.SHIFTED),
    _of_monitor("integrity_unavailable", CAUTION, "GROUND CLEARANCE NOT MONITORED", STATES.UNAVAILABLE, Reason.STALE),
    Case(
        "glide_slope", CAUTION, "GLIDE SLOPE FLAGGED", _outputs(_glide(2, valid=False)),
        _outputs(_glide(3, valid=True)), _outputs(integrity(1, OK), _glide(1, valid=True)),
    ),
    Case(
        "height", CAUTION, "HEIGHT NOT VALID",
        _outputs(altimeter(2, "radar", Reason.STALE), height(2, Reason.NO_HEIGHT)), _outputs(height(3)),
        _outputs(altimeter(1, "radar"), height(1)),
    ),
    Case("altimeter:radar", CAUTION, "HEIGHT OF RADAR REFUSED", _outputs(*STUCK), _outputs(altimeter(3, "radar"))),
    _of_solution("position", CAUTION, "POSITION NOT VALID", **LOST),
    _of_solution("position_by:filter", CAUTION, "POSITION BY FILTER", **NO_DEVICE),
    _of_solution("position_by:radio", CAUTION, "POSITION BY RADIO", position_source="radio"),
    _of_solution("position_by:gnss", ADVISORY, "POSITION BY GNSS", position_source="gnss"),
    _of_solution("attitude", CAUTION, "ATTITUDE NOT VALID", **TILTED),
    _of_solution("attitude_by:filter", CAUTION, "ATTITUDE BY FILTER", attitude_source="filter"),
    _of_solution("altitude_by:filter", CAUTION, "ALTITUDE BY FILTER", altitude_source="filter"),
    _of_solution("altitude_by:vertical", CAUTION, "ALTITUDE BY VERTICAL CHANNEL", altitude_source="vertical"),
    Case(
        "source:gnss", CAUTION, "SOURCE GNSS REFUSED", _outputs(source(2, "gnss", Reason.JUMP)),
        _outputs(source(3, "gnss")),
    ),
    Case(
        "contradiction", CAUTION, "SOURCES CONTRADICT EACH OTHER", _outputs(_filter(2, Reason.CONTRADICTION)),
        _outputs(_filter(3)),
    ),
    Case(
        "ground_drift", CAUTION, "DRIFT OVER GROUND REFUSED",
        _outputs(_drift(2, Reason.REJECTED, Reason.CONTRADICTION)), _outputs(_drift(3)),
    ),
    Case(
        "reacquired", ADVISORY, "SOURCES REACQUIRED", _outputs(solution(3, unchecked=(Reason.REACQUIRED,))),
        _outputs(solution(4)), _outputs(solution(1, unchecked=(Reason.REACQUIRED,)), solution(2)),
    ),
    Case("terrain", CAUTION, "NO TERRAIN", _ground("a file is damaged"), _ground(None)),
    Case(
        "terrain_loading", ADVISORY, "TERRAIN LOADING", _health(navigation={"lag_ms": 1.0, "is_terrain_loading": True}),
        WELL, is_latched=False,
    ),
    Case(
        "navigation_starting", ADVISORY, "NAVIGATION STARTING", _processes(navigation={"state": "starting"}), WELL,
        lambda daemon: daemon.restart(), is_latched=False,
    ),
    Case("recording", WARNING, "NOT RECORDING", _health(storage={"state": "error", "hint": "full"}), WELL),
    Case("recording", WARNING, "NOT RECORDING", _processes(recorder={"state": "restarting"}), WELL),
    Case("recording", WARNING, "RECORDING TO A LOST FILE", _health(storage={"state": "gone", "hint": "removed"}), WELL),
    Case(
        "storage_fallback", CAUTION, "RECORDING TO THE FALLBACK",
        _health(storage={"state": "fallback", "hint": "full"}), WELL,
    ),
    Case("storage_full", CAUTION, "STORAGE ALMOST FULL", _health(storage={"state": "full", "hint": "90 MB"}), WELL),
    Case("storage_overdue", CAUTION, "NEXT FILE OVERDUE", _health(storage={"state": "overdue", "hint": "5 s"}), WELL),
    Case("storage_slow", CAUTION, "STORAGE SLOW", _health(storage={"state": "slow", "hint": "2 s"}), WELL),
    Case("space", CAUTION, "SPACE FOR LESS THAN AN HOUR", _use_space, WELL),
    Case("navigation", WARNING, "NAVIGATION STOPPED", _processes(navigation={"state": "restarting"}), WELL),
    Case(
        "navigation_late", CAUTION, "NAVIGATION LATE",
        lambda daemon: daemon.delay_navigation(0.6), lambda daemon: daemon.delay_navigation(0.1),
    ),
    Case("link:line", CAUTION, "LINK LINE ABSENT", _health(links=link("absent")), WELL),
    Case("link:line", CAUTION, "LINK LINE DENIED", _health(links=link("denied")), WELL),
    Case("link:line", CAUTION, "LINK LINE BUSY", _health(links=link("busy")), WELL),
    Case("link:line", CAUTION, "LINK LINE SILENT", _health(links=link("silent")), WELL),
    Case("device:ins", CAUTION, "DEVICE INS SILENT", _health(devices=device("silent")), WELL),
    Case("device:ins", CAUTION, "DEVICE INS NOISE", _health(devices=device("noise")), WELL),
    Case("device:ins", CAUTION, "DEVICE INS INVALID", _health(devices=device("invalid")), WELL),
    Case(
        "device:ins", CAUTION, "DEVICE INS WRONG RATE", _health(devices=device("wrong rate")), WELL,
        _health(devices=device("wrong rate")),
    ),
    Case("losses", CAUTION, "DATA LOST", _lose(dropped_frames=3), None),
    Case("stamps", CAUTION, "KERNEL STAMPS REFUSED", _lose(stamp_refused=3), None),
    Case("clock_step", CAUTION, "COMPUTER CLOCK STEPPED", _step_clock, None),
    Case("recorder", CAUTION, "RECORDER REPLACED", lambda daemon: daemon.board.on_recorder_replaced("killed"), None),
    Case(
        "process:display", CAUTION, "DISPLAY FAILS REPEATEDLY", _processes(display={"restarts": MIN_RESTARTS}),
        _a_minute_later,
    ),
)  # fmt: skip


def daemon_with(case: Case) -> Daemon:
    """A daemon with one alarm, active or past."""
    daemon = Daemon()
    case.before(daemon)
    case.begins(daemon)
    return daemon
