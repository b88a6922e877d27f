"""The aircraft whose messages arrive through a router: the state of each, and events that are missing.

Has no clock, port or thread; ``now_ns`` is monotonic time [ns].  Messages come from other computers and are checked as
those of the bus.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from fti.bus.message import MessageError, decode, shorten
from fti.ground.link_delay import LinkDelay
from fti.messages.topics import BUS_EVENT, BUS_HEALTH
from fti.web.live_state import Contact, LiveState

#: Aircraft beyond this number are ignored.
MAX_AIRCRAFT = 64
MAX_NAME = 64
#: At most so many missing events are requested at once.
MAX_REPAIR = 200
NS_PER_MS = 1_000_000
WARNING_PERIOD_NS = 10_000_000_000
#: After this silence a session is followed by any other one, also by one whose computer has an earlier time.
SUCCESSION_NS = 60_000_000_000
#: Time of the start, and number, at the end of the name of a session.
SESSION_START = re.compile(r"_(\d{8}T\d{6}Z)_(\d{1,9})$")
LOST = "no message from the aircraft for {silence_s:.1f} s; its state is unknown"


class Key(NamedTuple):
    """A key of zenoh: ``fti/<aircraft>/<session><topic>``."""

    aircraft: str
    session: str
    topic: str

    @classmethod
    def parse(cls, text: str) -> Key | None:
        """The parts of a key; None for another key."""
        parts = text.split("/", 3)
        if len(parts) != 4 or parts[0] != "fti" or not all(0 < len(part) <= MAX_NAME for part in parts[1:3]):
            return None
        return cls(parts[1], parts[2], f"/{parts[3]}")

    @property
    def start(self) -> tuple[str, int, str]:
        """Orders the sessions of an aircraft by their start; their names may begin differently."""
        found = SESSION_START.search(self.session)
        return (found[1], int(found[2]), self.session) if found else ("", 0, self.session)


class MissingEvents(NamedTuple):
    """Numbers of events that did not arrive, ``first`` to ``last``."""

    aircraft: str
    session: str
    first: int
    last: int


class Aircraft:
    """The newest session of an aircraft.

    max_age_ms : outputs are late above this age, or above their own limit if it is larger [ms]
    """

    def __init__(self, key: Key, now_ns: int, max_age_ms: float) -> None:
        self.key, self.name, self.session = key, key.aircraft, key.session
        self.live = LiveState(now_ns, Contact("NO CONTACT", LOST, max(2.0 * max_age_ms, 5000.0), by_health=False))
        self.last_ns = now_ns
        self._max_age_ms = max_age_ms
        self._delay = LinkDelay()
        self._boot = ""
        self._is_replay = False
        self._last_event = 0
        self._refused, self._warning_due_ns = 0, now_ns

    def update(self, topic: str, payload: bytes, now_ns: int) -> MissingEvents | None:
        """Handle a message; returns the events before it that have not arrived."""
        name = BUS_EVENT if topic.startswith(f"{BUS_EVENT}/") else topic
        try:
            fields = decode(name, payload)
        except MessageError as error:
            self._refuse(topic, str(error), now_ns)
            return None
        boot, number = str(fields.pop("boot", "")), fields.pop("number", 0)
        self.last_ns = now_ns
        if boot != self._boot:  # numbers and times may begin again
            self._boot, self._last_event, self._delay = boot, 0, LinkDelay()
        if name != BUS_EVENT:
            self._show(name, fields, now_ns)
            return None
        if topic == name:
            return self._handle_event(number if isinstance(number, int) else 0, fields, now_ns)
        self.live.update(name, fields, now_ns)  # the answer to a query
        return None

    def _show(self, topic: str, fields: dict[str, Any], now_ns: int) -> None:
        if topic == BUS_HEALTH:
            self._is_replay = fields["session"].get("origin") == "replay"
        if self._is_replay:  # its times are repeated, or pass faster: they do not show the delay of the link
            self._delay = LinkDelay()
        elif isinstance(t_ns := fields.get("t_ns"), int):  # a message without a time has waited as the last one
            self._delay.update(t_ns + round((fields.get("age_ms") or 0.0) * NS_PER_MS), now_ns)
        if "max_age_ms" in fields:
            fields["max_age_ms"] = max(fields["max_age_ms"], self._max_age_ms)
        self.live.update(topic, fields, now_ns - self._delay.delay_ns)

    def _handle_event(self, number: int, fields: dict[str, Any], now_ns: int) -> MissingEvents | None:
        """Show an event once; returns the missing ones before it."""
        if number <= self._last_event:  # sent again
            return None
        first, self._last_event = max(self._last_event + 1, number - MAX_REPAIR), number
        self.live.update(BUS_EVENT, fields, now_ns)
        return MissingEvents(self.name, self.session, first, number - 1) if first < number else None

    def _refuse(self, topic: str, why: str, now_ns: int) -> None:
        self._refused += 1
        if now_ns >= self._warning_due_ns:
            self._warning_due_ns = now_ns + WARNING_PERIOD_NS
            text = f"{self._refused} messages refused, the last on {topic[:100]!a}: {why}"
            self.live.warn("zenoh", shorten(text), now_ns)


class Fleet:
    """All aircraft by their names; may be fed and read from any thread.

    max_age_ms : see ``Aircraft``
    """

    def __init__(self, max_age_ms: float) -> None:
        self._max_age_ms = max_age_ms
        self._lock = threading.Lock()
        self._aircraft: dict[str, Aircraft] = {}

    def update(self, key: str, payload: bytes, now_ns: int) -> MissingEvents | None:
        """Handle a message; returns events that have not arrived."""
        if (parsed := Key.parse(key)) is None:
            return None
        with self._lock:
            aircraft = self._find(parsed, now_ns)
            return aircraft.update(parsed.topic, payload, now_ns) if aircraft else None

    def _find(self, key: Key, now_ns: int) -> Aircraft | None:
        """The aircraft of a message; None for an old session, or when there are too many aircraft."""
        known = self._aircraft.get(key.aircraft)
        if known and known.session == key.session:
            return known
        is_newer = known is not None and (key.start > known.key.start or now_ns - known.last_ns > SUCCESSION_NS)
        if (known is None and len(self._aircraft) < MAX_AIRCRAFT) or is_newer:
            known = self._aircraft[key.aircraft] = Aircraft(key, now_ns, self._max_age_ms)
            return known
        return None

    def set_alive(self, key: str, is_alive: bool) -> None:
        """Handle the liveliness token of an aircraft: it is connected, or no longer."""
        parsed = Key.parse(key)
        with self._lock:
            known = self._aircraft.get(parsed.aircraft) if parsed else None
            if known and parsed and known.session == parsed.session:
                known.live.set_alive("supervisor", is_alive)

    def find(self, name: str) -> LiveState | None:
        """The live state of an aircraft."""
        with self._lock:
            known = self._aircraft.get(name)
            return known.live if known else None

    def states(self, now_ns: int) -> dict[str, dict[str, Any]]:
        """State of each aircraft, as of the page, with ``session`` and ``contact_ms``, by name."""
        with self._lock:
            known = sorted(self._aircraft.items())
        return {
            name: {
                **aircraft.live.state(now_ns),
                "session": aircraft.session,
                "contact_ms": (now_ns - aircraft.last_ns) / NS_PER_MS,
            }
            for name, aircraft in known
        }


def summaries(states: Mapping[str, Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """One row for each aircraft, for an overview.

    aircraft, session : names;  contact_ms : time since the last message [ms];  origin : flight, hil, replay; "" unknown
    position, height, integrity, glide : outputs with their ``valid``; None before the first one
    alarms : number of alarms that are active and not acknowledged;  worst : the first one; None without one
    """
    for name, state in states.items():
        outputs = state["outputs"]
        alarms = [a for a in state["alarms"] if a["end_ns"] is None and not a["is_acknowledged"]]
        health = state["health"] or {}
        yield {
            "aircraft": name,
            "session": state["session"],
            "contact_ms": state["contact_ms"],
            "origin": health.get("session", {}).get("origin", ""),
            "position": outputs.get("/nav/nav_solution"),
            "height": outputs.get("/nav/height_below_aircraft"),
            "integrity": outputs.get("/nav/clearance_integrity"),
            "glide": outputs.get("/nav/glide_slope"),
            "alarms": len(alarms),
            "worst": {key: alarms[0][key] for key in ("severity", "title")} if alarms else None,
        }
