"""Operator requests: marks, snapshots, commands to devices, readmission of sources, acknowledgement."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fti.clock import Clock
from fti.config import Config, position_sources
from fti.messages import control
from fti.messages.frames import ALL_SOURCES
from fti.messages.outputs import Event
from fti.messages.tables import to_table
from fti.service.supervisor.alarm_board import AlarmBoard
from fti.service.supervisor.child_monitor import RecorderOutbox
from fti.service.supervisor.command_tracker import CommandTracker
from fti.service.supervisor.control_socket import Answer
from fti.service.supervisor.event_publisher import EventPublisher


class OperatorRequests:
    """Executes the requests of operators.

    send_to_display    : sends a message to the display process, if it runs
    send_to_navigation : sends a message to the navigation process; False if it does not run
    """

    def __init__(
        self,
        config: Config,
        clock: Clock,
        *,
        command_tracker: CommandTracker,
        outbox: RecorderOutbox,
        event_publisher: EventPublisher,
        send_to_display: Callable[[control.ToDisplay], None],
        send_to_navigation: Callable[[control.ToNavigation], bool],
        alarms: AlarmBoard,
    ) -> None:
        self._config, self._clock = config, clock
        self._command_tracker, self._outbox, self._event_publisher = command_tracker, outbox, event_publisher
        self._send_to_display, self._send_to_navigation = send_to_display, send_to_navigation
        self._alarms = alarms

    async def handle_command(self, command: dict[str, Any], who: str) -> Answer:
        """Execute a command of the control socket, and return the answer."""
        if isinstance(command.get("send"), dict):
            return await self._command_tracker.handle_command(command["send"], who)
        if "commands" in command:
            return {"devices": [to_table(device) for device in self._command_tracker.catalogue.describe()]}
        if "readmit" in command:
            return self._readmit(command["readmit"], who)
        if "acknowledge" in command:
            return self._acknowledge(command["acknowledge"], who)
        return self._mark(command.get("mark"), who, is_trigger=bool(command.get("trigger")))

    def send_commands_to_display(self) -> None:
        """After the start of the display process, send it catalogue and recent commands."""
        self._send_to_display(control.UsableDevices(tuple(self._command_tracker.catalogue.usable())))
        for command in self._command_tracker.recent():
            self._send_to_display(command)

    def on_page_message(self, message: control.FromPage) -> None:
        """Execute a request of the display process."""
        who = f"the page (the owner's key, {message.who})"
        match message:
            case control.PageMark():
                if fault := self._mark(message.text, who, is_trigger=message.is_trigger).get("fault"):
                    self._event_publisher.publish_event("warning", "mark", fault)
            case control.PageCommand():
                self._command_tracker.begin(to_table(message), who)
            case control.PageAcknowledgement():
                self._acknowledge(message.alarm_id, who)

    def _acknowledge(self, alarm_id: Any, who: str) -> Answer:
        """Acknowledge one alarm with its consequences, or all (None)."""
        if not isinstance(alarm_id, str | None):
            return {"fault": f"{alarm_id!r} is not an alarm id"}
        return {"acknowledged": self._alarms.acknowledge(who, alarm_id), "t_ns": self._clock.now_ns()}

    def _readmit(self, source: Any, who: str) -> Answer:
        """Make navigation readmit a position source, or all sources; an event records the user."""
        sources = position_sources(self._config.nav)
        if source not in (ALL_SOURCES, *sources):
            return {"fault": f"{source!r} is not a position source; configured: {', '.join(sources) or 'none'}"}
        if not self._send_to_navigation(control.Readmit(source)):
            return {"fault": "navigation is restarting; repeat the command when it runs"}
        now = self._clock.now_ns()
        if source == ALL_SOURCES:
            self._alarms.start_new_flight(who)
        text = "all sources; navigation is reset" if source == ALL_SOURCES else str(source)
        self._event_publisher.forward_event(Event(t_ns=now, level="info", source="readmit", text=text), who)
        return {"t_ns": now}

    def _mark(self, text: Any, who: str, *, is_trigger: bool) -> Answer:
        now = self._clock.now_ns()
        if not isinstance(text, str):
            return {"fault": "unknown command"}
        if is_trigger and (fault := self._trigger(text, now)):
            return {"fault": fault}
        source = "trigger" if is_trigger else "mark"
        self._event_publisher.forward_event(Event(t_ns=now, level="info", source=source, text=text), who)
        return {"t_ns": now}

    def _trigger(self, text: str, t_ns: int) -> str | None:
        """Trigger the snapshot; returns the fault, or None."""
        if self._config.snapshot is None:
            return f"{self._config.path} has no [snapshot] table; a trigger needs one"
        if not self._outbox.send(control.SnapshotTrigger(text, t_ns)):
            return "the recorder is restarting; the snapshot memory is empty"
        return None
