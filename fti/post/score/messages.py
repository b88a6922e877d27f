"""Reads flags from the messages of a recorded session.

A counter (errors of a line, refused bytes) is a flag from the report in which it grows to the first in which it does
not.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from fti.alarms.alarm_list import AlarmChange
from fti.config import Config
from fti.hil.oracle.alarm_flags import COMPUTER_ALARMS
from fti.hil.oracle.flag_definitions import DEVICES, GROUND_DRIFT, HEIGHT, INTEGRITY, LEDGER, LINKS, SOLUTION
from fti.logger.reading.json_message import parse_table, using_message
from fti.logger.reading.note_states import NoteStates
from fti.logger.reading.recording import Recording
from fti.messages.outputs import IntegrityState
from fti.messages.reasons import Reason
from fti.messages.topics import ALARM_TOPIC, EVENT_TOPIC, HEALTH_TOPIC, TICK_TOPIC
from fti.nav.navigation import FILTER, RADIO
from fti.post.score.alarm_states import AlarmStates, has_states
from fti.post.score.observed_flags import NOTHING, STATUS, ObservedFlags, Words
from fti.post.score.outputs.consistency import PROFILE_REASONS
from fti.post.score.truth_reader import PAUSE_S, FlightPause, FlightTruth
from fti.service.navigation.device_monitor import NO_FRAME_REASONS

#: Reasons that depend on the position only and are not flags: of heights, and of outputs along a profile.
RANGE = frozenset((Reason.ABOVE_RANGE, Reason.BELOW_RANGE))
POSITION_REASONS = RANGE | PROFILE_REASONS
#: Reasons of a drift over the ground that are flags; the others depend on the ground and on the flight.
DRIFT_REASONS = frozenset((Reason.CONTRADICTION,))
#: Reasons when no device has a role.
REASONS_OF_ROLE = {
    "attitude": (Reason.NO_ATTITUDE,),
    "position": (Reason.NO_POSITION, Reason.NO_ALTITUDE, Reason.NO_VELOCITY),
}
#: Reasons of missing terrain, which depend on the position.
UNKNOWN_GROUND = {Reason.TERRAIN_EDGE, Reason.TERRAIN_HOLE}
#: Sources of a role that are not devices.
NO_DEVICE = (FILTER, RADIO)
FLAG_STATES = (IntegrityState.CAUTION, IntegrityState.ALERT)
WARNING = 3
#: Navigation with a larger lag is behind [s].
LAG_S = 0.5
#: Reason for which a decoder drops an incomplete message, and the maximum size of one [bytes].
PAUSE, TORN_BYTES = "pause", 64
CLOCK_KNOWN = "clock known"

Statement = tuple[str, Words]


def read_observed_flags(
    recording: Recording, config: Config, flight_truth: FlightTruth, channels: Iterable[str]
) -> ObservedFlags:
    """Read the flags from the beginning of a flight to its end.  channels : of ``[[expect]]``, topic and field

    Also keeps the values of the standard deviations that devices state with a position.
    """
    observed_flags = ObservedFlags(first_report_s=math.inf, last_report_s=-math.inf, ticks=(math.inf, -math.inf))
    wanted: dict[str, list[str]] = defaultdict(list)
    stated = [f"/{device.name}/position.{axis}_sd" for device in config.device for axis in ("horizontal", "vertical")]
    for channel in {*channels, *stated}:
        topic, _, name = channel.rpartition(".")
        wanted[topic].append(name)
    reader, states, alarms = FlagReader(config), NoteStates(), AlarmStates(config, observed_flags)
    for topic, t_ns, record in _messages(recording):
        t = flight_truth.seconds(t_ns)
        data = states.complete(topic, t_ns, record)
        if t > flight_truth.truth.end_s:
            continue
        if topic == TICK_TOPIC:
            reader.tick(t, observed_flags)
            continue
        with using_message(topic, t_ns):
            if topic == HEALTH_TOPIC:
                reader.lag(t, data, observed_flags)
            statements = list(reader.read(topic, data))
            _check_words(statements)
            content = parse_table(data) if topic in wanted or topic == HEALTH_TOPIC or has_states(topic) else {}
            if topic == HEALTH_TOPIC:
                alarms.feed_health(t, content)
            elif has_states(topic):
                alarms.feed_output(t, topic, content)
        for place, words in statements:
            observed_flags.feed(t, place, words - {CLOCK_KNOWN})
            if CLOCK_KNOWN in words:
                observed_flags.clocks.setdefault(place.rpartition("/")[2], t)
        if topic in wanted and t >= 0.0:
            for name in wanted[topic]:
                observed_flags.values[f"{topic}.{name}"].append((t, content.get(name)))
    observed_flags.finish()
    return observed_flags


def _check_words(statements: Iterable[Statement]) -> None:
    """Raises ValueError for a flag that is not a text."""
    if wrong := [word for _, words in statements for word in words if not isinstance(word, str)]:
        raise ValueError(f"{str(wrong[0])[:40]} is not a text")


def _messages(recording: Recording) -> Iterator[tuple[str, int, bytes]]:
    """Topic, log time and data of all messages; events are in both files, and the raw file has all of them."""
    for topic, t_ns, _, _, data in recording.messages("/fti/", kind="raw"):
        yield topic, t_ns, data
    for topic, t_ns, _, _, data in recording.messages(kind="derived"):
        if not topic.startswith("/fti/"):
            yield topic, t_ns, data


class FlagReader:
    """Reads the flags in the messages of each topic."""

    def __init__(self, config: Config) -> None:
        self._roles = {"position": config.nav.position[:1], "attitude": config.nav.attitude[:1]}
        self._missing = {
            reason for role, reasons in REASONS_OF_ROLE.items() for reason in reasons if not self._roles[role]
        }
        self._devices = {device.name for device in config.device}
        self._counts: dict[str, int] = {}
        self._alarms = frozenset[str]()
        self._lag_begin_s = math.inf

    def tick(self, t: float, observed_flags: ObservedFlags) -> None:
        """Add a tick of the recorder; it comes every 20 ms, unless the recorder stalls or the session was cut."""
        first_s, last_s = observed_flags.ticks
        if t - last_s > PAUSE_S and math.isfinite(last_s):
            observed_flags.tick_gaps.append(FlightPause(last_s, t))
        observed_flags.ticks = min(first_s, t), max(last_s, t)

    def lag(self, t: float, data: bytes, observed_flags: ObservedFlags) -> None:
        """Add first and last report of navigation, and the intervals in which it was behind.

        Health has the lag also while navigation reports nothing; then it has a hint.
        """
        navigation = parse_table(data)["navigation"]
        lag_ms = navigation.get("lag_ms")
        if lag_ms is None:
            return
        observed_flags.first_report_s = min(observed_flags.first_report_s, t)
        if "hint" not in navigation:
            observed_flags.last_report_s = t
        if lag_ms / 1e3 > LAG_S:
            observed_flags.lag_intervals.append(FlightPause(min(t - lag_ms / 1e3, self._lag_begin_s), t))
        self._lag_begin_s = t if lag_ms / 1e3 > LAG_S else math.inf

    def read(self, topic: str, data: bytes) -> Iterator[Statement]:
        """The flags of a message at each of its places."""
        if topic.startswith("/nav/"):
            yield from self._navigation(topic, data)
        elif topic in (HEALTH_TOPIC, LEDGER, EVENT_TOPIC, ALARM_TOPIC):
            rules: Mapping[str, Callable[[Any], Iterator[Statement]]] = {
                HEALTH_TOPIC: self._health,
                LEDGER: self._ledger,
                EVENT_TOPIC: _event,
                ALARM_TOPIC: self._alarm,
            }
            yield from rules[topic](parse_table(data))
        elif topic.split("/")[1] in self._devices:
            yield topic, _device(topic, data)

    def _navigation(self, topic: str, data: bytes) -> Iterator[Statement]:
        if topic not in (SOLUTION, INTEGRITY, GROUND_DRIFT) and not topic.startswith(HEIGHT):
            return
        content = parse_table(data)
        if topic == GROUND_DRIFT:
            yield topic, DRIFT_REASONS.intersection(content["reasons"])
            return
        words = frozenset(content["reasons"]) - self._missing
        if topic == SOLUTION:
            words |= frozenset(self._sources(content))
        elif topic.startswith(HEIGHT):
            words = (words - RANGE) | (UNKNOWN_GROUND & set(content["unchecked"]))
        elif topic == INTEGRITY:
            words = (words - POSITION_REASONS) | ({content["state"]} & set(FLAG_STATES))
        yield topic, words

    def _sources(self, content: Mapping[str, Any]) -> Iterator[str]:
        """Roles whose source is not the preferred device, and roles whose source is not a device."""
        for role, preferred in self._roles.items():
            source = content[f"{role}_source"]
            if preferred and source != preferred[0]:
                yield f"{role} not from {preferred[0]}"
            if source in NO_DEVICE:
                yield f"{role} from {source}"

    def _health(self, content: Mapping[str, Any]) -> Iterator[Statement]:
        for name, device in content["devices"].items():
            place = f"{DEVICES}/{name}"
            words = {device["state"]} - {"good"}
            words |= {CLOCK_KNOWN for clock in device["clocks"] if clock["drift_ppm"] is not None}
            words |= {"clock away" for clock in device["clocks"] if clock["state"] == "away"}
            skipped = device.get("skipped", {})
            yield place, frozenset(words | ({"damaged bytes"} if self._is_damaged(place, skipped) else set()))
        for name, link in content["links"].items():
            own = {"absent", "denied", "busy", "silent"} & {link["state"]}
            yield f"{LINKS}/{name}", frozenset(own)

    def _ledger(self, content: Mapping[str, Any]) -> Iterator[Statement]:
        for name, link in content["links"].items():
            place = f"{LEDGER}/{name}"
            grown = [error for error, n in link.get("errors", {}).items() if self._grows(f"{place}/{error}", n)]
            lost = [reason for reason, n in link["dropped"].items() if self._grows(f"{place}/{reason}", n["frames"])]
            yield place, frozenset((*grown, *lost))

    def _alarm(self, content: Mapping[str, Any]) -> Iterator[Statement]:
        """The alarms with an active condition, without those of the computer."""
        change, name = content["change"], content["id"]
        if change in (AlarmChange.BEGINS, AlarmChange.ENDS) and name not in COMPUTER_ALARMS:
            self._alarms = self._alarms | {name} if change == AlarmChange.BEGINS else self._alarms - {name}
            yield ALARM_TOPIC, self._alarms

    def _is_damaged(self, place: str, skipped: Mapping[str, int]) -> bool:
        """Were bytes refused?  One message in two parts with a pause comes from a busy computer, and does not count."""
        refused = sum(n for reason, n in skipped.items() if reason not in NO_FRAME_REASONS or reason == "no_sync")
        is_small = refused - self._counts.get(place, refused) <= TORN_BYTES
        has_pause = self._grows(f"{place}/{PAUSE}", skipped.get(PAUSE, 0))
        return self._grows(place, refused) and not (is_small and has_pause)

    def _grows(self, key: str, count: int) -> bool:
        before = self._counts.get(key, count)
        self._counts[key] = count
        return count > before


def _event(content: Mapping[str, Any]) -> Iterator[Statement]:
    """Warnings and errors; each is a flag for a moment."""
    if content["level"] >= WARNING:
        place = f"{EVENT_TOPIC}/{content['name']}"
        yield place, frozenset((content["message"],))
        yield place, NOTHING


def _device(topic: str, data: bytes) -> Words:
    """Flags of a device status or of a measurement."""
    if topic.endswith(STATUS):
        content = parse_table(data)
        return NOTHING if content["ok"] else frozenset(("invalid", *content["flags"]))
    return frozenset(("invalid",)) if b'"valid":false' in data else NOTHING
