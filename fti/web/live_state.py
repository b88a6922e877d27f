"""State of a display: the latest message of every topic with its present age, events and alarms.

May be fed from any thread; has no clock, port or thread.  ``now_ns`` is monotonic time [ns] throughout.
Alarms come from the daemon; a display adds only one, when the daemon is silent.
Values age: ``age_ms`` = age at publication + time since arrival.  Above its ``max_age_ms``, or when navigation or the
daemon has stopped, a value is late for every consumer, and a late value is not valid.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from fti.alarms.alarm_list import Alarm
from fti.alarms.condition import Condition, Severity
from fti.messages.outputs import IntegrityState
from fti.messages.topics import BUS_ALARMS, BUS_HEALTH
from fti.reason_texts import describe_reasons

Fields = Mapping[str, Any]

NS_PER_MS = 1_000_000
MAX_EVENTS = 50
MAX_TOPICS = 256
DEFAULT_MAX_AGE_MS = 1000.0
#: The daemon publishes health twice a second; after this silence it counts as stopped.
HEALTH_LIMIT_MS = 2000.0
#: While one of these alarms is active, all outputs are late.
OUTPUT_STOPPING_ALARMS = frozenset({"navigation", "daemon"})
#: Required fields of a message of an emulator.
HIL_FIELDS = frozenset(("scenario", "flight_s", "duration_s", "devices", "faults", "supply_v", "lateness", "holds"))
#: Fields of the navigation solution with reasons of its attitude.
ATTITUDE_REASON_FIELDS = ("attitude_reasons", "attitude_unchecked")


SPAN_NS = 120_000_000_000
PERIOD_NS = 200_000_000
GAP_NS = 1_000_000_000  # a longer interruption is a gap in the lines
HEIGHT = "/nav/height_above_ground/"
GLIDE = "/nav/glide_slope"


STATES: dict[str, str] = {
    IntegrityState.NO_PROFILE: "no approach profile loaded",
    IntegrityState.ACQUIRE: "collecting the first window",
    IntegrityState.MONITOR: "heights match; position not observable here",
    IntegrityState.OK: "ground matches the published approach",
    IntegrityState.CAUTION: "one test over its limit",
    IntegrityState.ALERT: "do not trust height or position",
    IntegrityState.UNAVAILABLE: "monitor not available",
}


#: Recording modes other than continuous: banner and explanation.
MODES: dict[str, tuple[str, str]] = {"snapshot": ("SNAPSHOT", "only data around a trigger are recorded")}
CONTINUOUS = "continuous"


def describe_mode(mode: str) -> tuple[str, str]:
    """Banner and explanation of a mode that is not continuous."""
    return MODES.get(mode, (mode.upper(), ""))


class History:
    """The plotted values of the last two minutes, five rows per second, on one time axis.

    A row is ``{series: value}``; a series is ``topic:field``, an invalid value is None.
    """

    def __init__(self) -> None:
        self._rows: deque[tuple[int, dict[str, float | None]]] = deque()
        self._now: dict[str, float | None] = {}

    def update(self, topic: str, fields: Mapping[str, Any]) -> None:
        """Handle an output; add a row if the last one is old enough."""
        if not topic.startswith((HEIGHT, GLIDE)) or not isinstance(fields.get("t_ns"), int):
            return
        self._now |= _values(topic, fields)
        t_ns = fields["t_ns"]
        last_ns = self._rows[-1][0] if self._rows else t_ns - PERIOD_NS
        if t_ns - last_ns > GAP_NS:
            self._rows.append((last_ns + PERIOD_NS, {}))
        if t_ns - last_ns >= PERIOD_NS:
            self._rows.append((t_ns, dict(self._now)))
            while self._rows[0][0] < t_ns - SPAN_NS:
                self._rows.popleft()

    def message(self) -> dict[str, Any]:
        """``{"type": "history", "t": [s], "series": {name: [value]}}``."""
        series = {name: [row.get(name) for _, row in self._rows] for name in sorted(self._now)}
        return {"type": "history", "t": [t_ns / 1e9 for t_ns, _ in self._rows], "series": series}


def _values(topic: str, fields: Mapping[str, Any]) -> dict[str, float | None]:
    valid = bool(fields.get("valid")) and not fields.get("late")
    if topic.startswith(HEIGHT):
        raw = None if fields.get("late") else fields.get("raw")
        return {f"{topic}:raw": raw, f"{topic}:height_agl": fields.get("height_agl") if valid else None}
    return {f"{topic}:{name}": fields.get(name) if valid else None for name in ("deviation", "dh")}


@dataclass(frozen=True, slots=True)
class ReceivedMessage:
    """A message and its arrival time."""

    fields: Fields
    at_ns: int

    def elapsed_ms(self, now_ns: int) -> float:
        """Time since its arrival [ms]."""
        return (now_ns - self.at_ns) / NS_PER_MS

    def age_ms(self, now_ns: int) -> float:
        """Present age of the value [ms]."""
        return to_number(self.fields.get("age_ms")) + self.elapsed_ms(now_ns)

    def is_late(self, now_ns: int) -> bool:
        """It was late at publication, or has become too old since."""
        limit_ms = to_number(self.fields.get("max_age_ms"), DEFAULT_MAX_AGE_MS)
        return bool(self.fields.get("late")) or self.age_ms(now_ns) > limit_ms


def to_number(value: object, otherwise: float = 0.0) -> float:
    """A finite number from an untrusted value of the bus, or ``otherwise``."""
    try:
        found = float(value) if isinstance(value, int | float) else otherwise
    except OverflowError:  # an integer beyond the range of float
        return otherwise
    return found if math.isfinite(found) else otherwise


class Contact(NamedTuple):
    """When the source of the messages counts as silent.

    title, cause : of the alarm then; ``{silence_s}`` stands for the duration of the silence [s]
    limit_ms     : duration of the silence [ms];  by_health : only health messages break it
    """

    title: str
    cause: str
    limit_ms: float
    by_health: bool


DAEMON = Contact(
    "DAEMON STOPPED", "no health for {silence_s:.1f} s; the state of the recording is unknown", HEALTH_LIMIT_MS, True
)


class LiveState:
    """The state shown by the page and ``fti watch``."""

    def __init__(self, now_ns: int, contact: Contact = DAEMON) -> None:
        self._lock = threading.Lock()
        self._contact = contact
        self._last_message_ns = now_ns
        self._started = ReceivedMessage({}, now_ns)
        self._health: ReceivedMessage | None = None
        self._hil: ReceivedMessage | None = None
        self._outputs: dict[str, ReceivedMessage] = {}
        self._last_nav: ReceivedMessage | None = None
        self._events: deque[Fields] = deque(maxlen=MAX_EVENTS)
        self._alive: dict[str, bool] = {}
        self._alarms: list[Fields] = []
        self._history = History()

    def update(self, topic: str, fields: Fields, now_ns: int) -> None:
        """Handle a message of the bus.  now_ns : its publication time, used as arrival time"""
        with self._lock:
            self._last_message_ns = max(self._last_message_ns, now_ns)
            if topic == BUS_HEALTH:
                self._health = ReceivedMessage(fields, now_ns)
            elif topic == BUS_ALARMS:
                self._alarms = list(fields["alarms"])
            elif topic == "/event":
                self._events.append(fields)
            elif topic == "/hil":
                self._hil = ReceivedMessage(fields, now_ns) if fields.keys() >= HIL_FIELDS else self._hil
            elif topic in self._outputs or len(self._outputs) < MAX_TOPICS:
                self._last_nav = self._outputs[topic] = ReceivedMessage(fields, now_ns)
                self._history.update(topic, fields)

    def warn(self, source: str, text: str, now_ns: int) -> None:
        """Add a warning event of this display."""
        with self._lock:
            t_ns = self._fti_time_ns(now_ns)
            self._events.append({"t_ns": t_ns, "level": "warning", "source": source, "text": text})

    def set_alive(self, process: str, is_alive: bool) -> None:
        """Set whether a process is alive."""
        with self._lock:
            self._alive[process] = is_alive

    def state(self, now_ns: int) -> dict[str, Any]:
        """The complete present state, ready for JSON."""
        with self._lock:
            alarms = [*self._daemon_alarms(now_ns), *self._alarms]
            stopped = any(alarm["id"] in OUTPUT_STOPPING_ALARMS and alarm["end_ns"] is None for alarm in alarms)
            stopped = stopped or not self._alive.get("navigation", True)
            health = self._health
            last_ns = max(r.at_ns for r in (self._started, self._health, self._last_nav) if r)
            return {
                "type": "state",
                "t_ns": self._fti_time_ns(now_ns),
                "health": health.fields if health else None,
                "health_age_ms": round((health or self._started).elapsed_ms(now_ns), 1),
                "hil": _with_age(self._hil, now_ns) if self._hil else None,
                "outputs": {topic: _display_fields(o, now_ns, stopped) for topic, o in sorted(self._outputs.items())},
                "events": list(self._events),
                "alarms": alarms,
                "stale_bus_ms": round((now_ns - last_ns) / NS_PER_MS, 1),
            }

    def history(self) -> dict[str, Any]:
        """The last two minutes for the plots, ready for JSON."""
        with self._lock:
            return self._history.message()

    def _fti_time_ns(self, now_ns: int) -> int | None:
        """Present FTI time, extrapolated from the last health message."""
        if self._health is None or "t_ns" not in self._health.fields:
            return None
        return int(to_number(self._health.fields["t_ns"])) + now_ns - self._health.at_ns

    def _daemon_alarms(self, now_ns: int) -> Iterator[dict[str, Any]]:
        """The alarm that the daemon is silent; none after the session state ``stopped``."""
        session = self._health.fields.get("session") if self._health else None
        if isinstance(session, Mapping) and session.get("state") == "stopped":
            return
        contact = self._contact
        last_ns = (self._health or self._started).at_ns if contact.by_health else self._last_message_ns
        silence_ms = (now_ns - last_ns) / NS_PER_MS
        if silence_ms <= contact.limit_ms and self._alive.get("supervisor", True):
            return
        cause = contact.cause.format(silence_s=silence_ms / 1000)
        began_ns = (self._fti_time_ns(now_ns) or 0) - round(silence_ms * NS_PER_MS)
        alarm = Alarm(Condition("daemon", Severity.WARNING, contact.title, cause), began_ns, began_ns)
        yield {**alarm.as_json(), "is_acknowledged": False, "consequences": []}


def _with_age(received: ReceivedMessage, now_ns: int) -> dict[str, Any]:
    return {**received.fields, "age_ms": round(received.age_ms(now_ns), 1), "late": received.is_late(now_ns)}


def _display_fields(received: ReceivedMessage, now_ns: int, stopped: bool) -> dict[str, Any]:
    fields = _with_age(received, now_ns)
    fields["late"] = late = fields["late"] or stopped
    fields["valid"] = bool(fields.get("valid")) and not late
    for key in ("reasons", "unchecked", *(key for key in ATTITUDE_REASON_FIELDS if key in fields)):
        fields[f"{key}_text"] = describe_reasons(fields.get(key))
    if "state" in fields:
        fields["state_text"] = STATES.get(str(fields["state"]), "")
    return fields
