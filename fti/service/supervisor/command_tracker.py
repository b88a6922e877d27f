"""Commands to devices: each is authorised, sent exactly once, and tracked until its final state.

A request comes from ``fti send`` or from the page.  The recorder sends the bytes and confirms this; the decoder in the
navigation process returns the answer of the device as an ``Ack``, which is matched to the oldest open command of that
device.  Each step is an event in the file: user, command, bytes, final state.

A client chooses the ``id`` of its request (any text).  A request with a known ``id`` is a repetition: it is not sent
again, and gets the same answer.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from fti.clock import Clock
from fti.constants import SECOND_NS
from fti.messages.control import CommandProgress, DeviceAnswer, SendBytes, SendResult
from fti.messages.tables import to_table
from fti.service.supervisor.command_catalogue import CommandCatalogue, CommandDenied
from fti.service.supervisor.command_request import CommandRequest, CommandState, TrackedCommand, parse_request

RECORDER = "recorder"
#: Margin for the confirmation of the recorder, after the last moment for sending [s].
CONFIRMATION_MARGIN_S = 1.0
#: Sending is timestamped after the write has returned; the answer by the kernel, at its first byte [ns].
MARGIN_NS = 20_000_000
#: Maximum number of open commands of a device.
MAX_OPEN = 32
#: Maximum number of answers that wait for the confirmation of sending; older ones are unexpected.
MAX_EARLY_ANSWERS = 100
#: Number of requests whose ``id`` is remembered, and of those on the page.
MAX_REMEMBERED = 4096
RECENT_COUNT = 20
#: An answer later than this after the timeout is not matched to the command [ns].
LATE_NS = 60 * SECOND_NS
#: Maximum number of events about unexpected answers in a period.
MAX_UNEXPECTED, UNEXPECTED_PERIOD_NS = 20, 10 * SECOND_NS

#: Level and text of an event.
ReportEvent = Callable[[str, str], None]


class CommandTracker:
    """Tracks the commands of a session.

    send         : sends a message to the recorder; False without a recorder
    report_event : publishes an event
    changed      : called whenever the state of a command changes
    delay_reason : reason why an answer may be late (navigation is behind, for example); "" if none
    """

    def __init__(
        self,
        catalogue: CommandCatalogue,
        clock: Clock,
        *,
        send: Callable[[SendBytes], bool],
        report_event: ReportEvent,
        changed: Callable[[CommandProgress], None],
        delay_reason: Callable[[], str],
    ) -> None:
        self.catalogue = catalogue
        self._clock = clock
        self._send, self._report_event = send, report_event
        self._changed, self._delay_reason = changed, delay_reason
        self._known: dict[str, TrackedCommand] = {}
        self._open: dict[int, TrackedCommand] = {}
        self._abandoned: deque[TrackedCommand] = deque(maxlen=MAX_OPEN)
        self._unexpected = UnexpectedAnswers(clock, report_event)
        self._number = 0
        self._closed = ""

    # -------------------------------------------------------------------------------------------------------- requests

    async def handle_command(self, message: Mapping[str, Any], who: str) -> dict[str, Any]:
        """Execute a request and return its final state; ``{"fault"}`` when it is denied."""
        request = self.begin(message, who)
        await request.end_event.wait()
        if request.state is CommandState.DENIED:
            return {"fault": request.detail}
        table: dict[str, Any] = to_table(request.progress())
        return table

    def begin(self, message: Mapping[str, Any], who: str) -> TrackedCommand:
        """Start the command of a request; returns the known command if its ``id`` is a repetition."""
        command_request = parse_request(message)
        if isinstance(command_request, str):
            return self._deny(CommandRequest("", "", "", {}, 0.0), who, command_request)
        first = self._known.get(command_request.key)
        if first and not first.command_request.is_same(command_request):
            return self._deny(command_request, who, f"id {command_request.key!r} is already used by another command")
        return first or self._start(command_request, who)

    def recent(self) -> list[CommandProgress]:
        """The last commands, oldest first."""
        return [request.progress() for request in list(self._known.values())[-RECENT_COUNT:]]

    def _start(self, command_request: CommandRequest, who: str) -> TrackedCommand:
        try:
            if self._closed:
                raise CommandDenied(self._closed)
            if (
                sum(request.command_request.device == command_request.device for request in self._open.values())
                >= MAX_OPEN
            ):
                raise CommandDenied(f"{command_request.device}: {MAX_OPEN} commands are already open")
            encoded = self.catalogue.encode(command_request.device, command_request.command, command_request.args)
        except CommandDenied as error:
            return self._remember(self._deny(command_request, who, str(error)))
        self._number += 1
        request = TrackedCommand(
            command_request, self._number, who, self._clock.now_ns(), encoded.data, encoded.answered
        )
        self._open[request.number] = self._remember(request)
        self._report_event("info", f"{request.title()} for {who}: {encoded.data.hex()}")
        self._hand_over(request, encoded.link)
        return request

    def _hand_over(self, request: TrackedCommand, link: str) -> None:
        until_ns = request.t_ns + round(request.command_request.timeout_s * SECOND_NS)
        if self._send(SendBytes(request.number, link, request.data.hex(), until_ns)):
            self._arm(request, request.command_request.timeout_s + CONFIRMATION_MARGIN_S)
            self._changed(request.progress())
        else:
            self._end(request, CommandState.NOT_SENT, "the recorder is restarting")

    def _deny(self, command_request: CommandRequest, who: str, why: str) -> TrackedCommand:
        """A denied command; it has no number."""
        request = TrackedCommand(command_request, 0, who, self._clock.now_ns(), b"", answered=False)
        request.end(CommandState.DENIED, why)
        self._report_event("warning", f"not sent for {who}: {why}")
        self._changed(request.progress())
        return request

    def _remember(self, request: TrackedCommand) -> TrackedCommand:
        self._known[request.command_request.key] = request
        if len(self._known) > MAX_REMEMBERED:
            del self._known[next(key for key, old in self._known.items() if old.end_event.is_set())]
        return request

    # -------------------------------------------------------------------------------------------- state changes

    def on_sent(self, result: SendResult) -> None:
        """Handle the confirmation of the recorder."""
        request = self._open.get(result.id)
        if request is None:
            return
        if result.fault:
            self._end(request, CommandState.UNKNOWN if result.partly else CommandState.NOT_SENT, result.fault)
        elif not request.answered:
            request.sent_ns = result.t_ns
            self._end(request, CommandState.SENT, "the device does not acknowledge it")
        else:
            request.state, request.sent_ns = CommandState.WAITING, result.t_ns
            self._arm(request, request.command_request.timeout_s)
            self._changed(request.progress())
            self._handle_early_answers(request)

    def on_ack(self, ack: DeviceAnswer) -> None:
        """Handle an answer of a device."""
        candidates = [r for r in self._open.values() if r.answered and r.matches_answer(ack, MARGIN_NS)]
        waiting = [request for request in candidates if request.state is CommandState.WAITING]
        if waiting:
            self._settle(waiting[0], ack)
        elif candidates:
            candidates[0].early_answers.append(ack)
            if len(candidates[0].early_answers) > MAX_EARLY_ANSWERS:
                self._unexpected.report(candidates[0].early_answers.pop(0))
        else:
            self._report_unexpected(ack)

    def _report_unexpected(self, ack: DeviceAnswer) -> None:
        late = next((r for r in self._recently_abandoned() if r.matches_answer(ack, MARGIN_NS)), None)
        if late:
            self._abandoned.remove(late)
            self._report_event("warning", f"{late.title()}: late answer: {late.describe_answer(ack)}")
        elif not (ack.accepted and self.catalogue.is_polled(ack.device)):
            self._unexpected.report(ack)

    def _settle(self, request: TrackedCommand, ack: DeviceAnswer) -> None:
        request.answered_ns = ack.t_ns
        detail = ack.detail
        uncertain = [r.number for r in self._recently_abandoned() if r.matches_answer(ack, MARGIN_NS)]
        if uncertain:
            remark = f"it may be the late answer to {uncertain[0]}"
            detail = f"{detail}; {remark}" if detail else remark
        self._end(request, CommandState.ACKNOWLEDGED if ack.accepted else CommandState.REFUSED, detail)

    def _recently_abandoned(self) -> list[TrackedCommand]:
        now = self._clock.now_ns()
        return [r for r in self._abandoned if now - r.t_ns < LATE_NS + round(r.command_request.timeout_s * SECOND_NS)]

    def on_child_ended(self, name: str) -> None:
        """The recorder or navigation has ended and is restarted; its unsent messages are lost."""
        for request in list(self._open.values()):
            request.delay_causes.append(f"{name} was restarted meanwhile")
            if name == RECORDER and request.early_answers:
                self._settle(request, request.early_answers.pop())
            elif name == RECORDER and request.state is CommandState.SENDING:
                self._end(request, CommandState.UNKNOWN, "the recorder ended before it confirmed sending")

    def close(self) -> None:
        """The session ends: no more commands are sent, and all open ones end."""
        self._closed = "the session is ending; no more commands are sent"
        for request in list(self._open.values()):
            progress = "sent, but" if request.state is CommandState.WAITING else "passed to the recorder, but"
            self._end(request, CommandState.UNKNOWN, f"{progress} the session ended before an answer came")

    def _arm(self, request: TrackedCommand, seconds: float) -> None:
        request.disarm()
        request.timer = asyncio.get_running_loop().call_later(seconds, self._expire, request)

    def _expire(self, request: TrackedCommand) -> None:
        reasons = [*dict.fromkeys(request.delay_causes), self._delay_reason()]
        causes = "".join(f"; {reason}" for reason in reasons if reason)
        limit = f"within {request.command_request.timeout_s:g} s"
        if request.early_answers:
            self._settle(request, request.early_answers.pop())
        elif request.state is CommandState.WAITING:
            self._end(request, CommandState.TIMED_OUT, f"no answer {limit}{causes}")
        else:
            self._end(request, CommandState.UNKNOWN, f"the recorder has not confirmed sending {limit}{causes}")

    def _end(self, request: TrackedCommand, state: CommandState, detail: str) -> None:
        if self._open.pop(request.number, None) is None:
            return  # already ended by an early answer
        request.end(state, detail)
        if request.answered and state in (CommandState.TIMED_OUT, CommandState.UNKNOWN):
            self._abandoned.append(request)
        self._report_event(state.level, f"{request.title()}: {request.outcome()}")
        self._changed(request.progress())
        self._handle_early_answers(request)

    def _handle_early_answers(self, request: TrackedCommand) -> None:
        """Handle the answers that came before the confirmation of sending."""
        for answer in request.take_early_answers():
            self.on_ack(answer)


class UnexpectedAnswers:
    """Answers that no command waits for: to data sent at connect, or to another program."""

    def __init__(self, clock: Clock, report_event: ReportEvent) -> None:
        self._clock, self._report_event = clock, report_event
        self._reported_ns: deque[int] = deque(maxlen=MAX_UNEXPECTED)
        self._suppressed = 0

    def report(self, ack: DeviceAnswer) -> None:
        """Publish an event, unless there were too many; suppressed ones are counted in the next event."""
        now = self._clock.now_ns()
        if len(self._reported_ns) == MAX_UNEXPECTED and now - self._reported_ns[0] < UNEXPECTED_PERIOD_NS:
            self._suppressed += 1
            return
        self._reported_ns.append(now)
        verb = "acknowledged" if ack.accepted else "refused"
        what = f"{ack.device}: {verb} {ack.command or 'an unnamed command'}"
        detail = f" ({ack.detail})" if ack.detail else ""
        suppressed = f"; {self._suppressed} earlier answers were not reported" if self._suppressed else ""
        self._suppressed = 0
        self._report_event("info" if ack.accepted else "warning", f"{what}{detail}: unexpected answer{suppressed}")
