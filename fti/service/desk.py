"""What people ask of the daemon: marks, snapshots, commands to devices, readmission of sources, acknowledgement."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fti.clock import Clock
from fti.config import Config, position_sources
from fti.service.alarm_board import AlarmBoard
from fti.service.bulletin import Bulletin
from fti.service.commands import Commander
from fti.service.control import Message
from fti.service.control_socket import Answer
from fti.service.keeping import RecorderMail
from fti.types import ALL_SOURCES


class Desk:
    """Answers people.

    show     : hands a message to the display process, which may not be there
    navigate : hands a message to the navigation process; False when it is not there
    """

    def __init__(
        self,
        config: Config,
        clock: Clock,
        *,
        commander: Commander,
        mail: RecorderMail,
        bulletin: Bulletin,
        show: Callable[[Message], None],
        navigate: Callable[[Message], bool],
        alarms: AlarmBoard,
    ) -> None:
        self._config, self._clock = config, clock
        self._commander, self._mail, self._bulletin, self._show = commander, mail, bulletin, show
        self._navigate, self._alarms = navigate, alarms

    async def obey(self, command: dict[str, Any], who: str) -> Answer:
        """Do what came over the control socket, and say what became of it."""
        if isinstance(command.get("send"), dict):
            return await self._commander.obey(command["send"], who)
        if "commands" in command:
            return {"devices": self._commander.catalogue.describe()}
        if "readmit" in command:
            return self._readmit(command["readmit"], who)
        if "acknowledge" in command:
            return self._acknowledge(command["acknowledge"], who)
        return self._mark(command, who)

    def hear_page(self, message: Message) -> None:
        """Do what the display process hands up; one that has just started is told what it shows of commands."""
        if "ready" in message:
            self._show({"catalogue": self._commander.catalogue.usable()})
            for command in self._commander.recent():
                self._show({"command": command})
        who = f"the page (the owner's key, {message.get('who')})"
        if "mark" in message and (fault := self._mark(message, who).get("fault")):
            self._bulletin.event("warning", "mark", fault)
        if "send" in message:
            self._commander.begin(message["send"], who)
        if "acknowledge" in message:
            self._acknowledge(message["acknowledge"], who)

    def _acknowledge(self, alarm_id: Any, who: str) -> Answer:
        """One alarm with its consequences, or all (None)."""
        if not isinstance(alarm_id, str | None):
            return {"fault": f"{alarm_id!r} is not the identity of an alarm"}
        return {"acknowledged": self._alarms.acknowledge(who, alarm_id), "t_ns": self._clock.now_ns()}

    def _readmit(self, source: Any, who: str) -> Answer:
        """Have navigation readmit a source of position, or all sources; an event records who commanded it."""
        sources = position_sources(self._config.nav)
        if source not in (ALL_SOURCES, *sources):
            return {"fault": f"{source!r} is not a source of position; there are {', '.join(sources) or 'none'}"}
        if not self._navigate({"readmit": source}):
            return {"fault": "navigation is being started again; repeat the command when it runs"}
        now = self._clock.now_ns()
        if source == ALL_SOURCES:
            self._alarms.begin_anew(who)
        text = "all sources; navigation begins anew" if source == ALL_SOURCES else str(source)
        self._bulletin.pass_on({"t_ns": now, "level": "info", "source": "readmit", "text": text}, who)
        return {"t_ns": now}

    def _mark(self, command: dict[str, Any], who: str) -> Answer:
        text, now = command.get("mark"), self._clock.now_ns()
        if not isinstance(text, str):
            return {"fault": "there is no such command"}
        if command.get("trigger") and (fault := self._trigger(text, now)):
            return {"fault": fault}
        source = "trigger" if command.get("trigger") else "mark"
        self._bulletin.pass_on({"t_ns": now, "level": "info", "source": source, "text": text}, who)
        return {"t_ns": now}

    def _trigger(self, text: str, t_ns: int) -> str | None:
        """Have the snapshot written; returns why it cannot be."""
        if self._config.snapshot is None:
            return f"{self._config.path} has no [snapshot] table, so there is nothing to trigger"
        if not self._mail.send({"trigger": text, "t_ns": t_ns}):
            return "the recorder is being started again; the snapshot's memory is empty"
        return None
