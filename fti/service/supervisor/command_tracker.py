"""Commands to devices: each is authorised, sent exactly once, and followed until it is known what became of it.

A wish comes from ``fti send`` or from the page.  The recorder sends the bytes and says so; the device's answer comes
out of its decoder in the navigation process as an ``Ack`` and is matched to the oldest open command of that device.
Whatever happens is an event, so that it stands in the file: who, what, the bytes, and the end.

A client numbers its wishes (``id``, any text).  The same ``id`` again is the same wish: it is not sent again, and is
answered as the first one.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from fti.clock import SECOND_NS, Clock
from fti.service.control_channel import ControlMessage
from fti.service.supervisor.command_catalogue import CommandCatalogue, CommandDenied
from fti.service.supervisor.command_request import CommandRequest, CommandState, TrackedCommand, parse_request

RECORDER = "recorder"
#: The recorder's word that a command was sent, or not, comes so much later than the last moment for sending [s].
CONFIRMATION_MARGIN_S = 1.0
#: A stamp of sending is taken when the write has returned; the answer's by the kernel, when its first byte came [ns].
MARGIN_NS = 20_000_000
#: Commands of one device that wait for their end.
MAX_OPEN = 32
#: Answers that wait for the word that a command was sent; the oldest of more was not for it.
MAX_EARLY_ANSWERS = 100
#: Wishes that are known again by their ``id``, and those among them that the page shows.
MAX_REMEMBERED = 4096
RECENT_COUNT = 20
#: An answer that comes so long after it was given up belongs to nothing [ns].
LATE_NS = 60 * SECOND_NS
#: Answers that nobody waits for are told one by one, up to so many in so long a time.
MAX_UNEXPECTED, UNEXPECTED_PERIOD_NS = 20, 10 * SECOND_NS

#: Level and text of an event.
ReportEvent = Callable[[str, str], None]


class CommandTracker:
    """Follows the commands of a session.

    send    : hands a message to the recorder; False when there is none
    tell    : makes an event
    changed : told of each command whenever its state changes, as ``TrackedCommand.describe`` has it
    hinder  : why an answer may be late (navigation is behind, say); "" when nothing is known
    """

    def __init__(
        self,
        catalogue: CommandCatalogue,
        clock: Clock,
        *,
        send: Callable[[ControlMessage], bool],
        tell: ReportEvent,
        changed: Callable[[dict[str, Any]], None],
        delay_reason: Callable[[], str],
    ) -> None:
        self.catalogue = catalogue
        self._clock = clock
        self._send, self._tell, self._changed, self._delay_reason = send, tell, changed, delay_reason
        self._known: dict[str, TrackedCommand] = {}
        self._open: dict[int, TrackedCommand] = {}
        self._given_up: deque[TrackedCommand] = deque(maxlen=MAX_OPEN)
        self._unexpected = UnexpectedAnswers(clock, tell)
        self._number = 0
        self._closed = ""

    # -------------------------------------------------------------------------------------------------------- wishes

    async def handle_command(self, message: Mapping[str, Any], who: str) -> dict[str, Any]:
        """Do what a client wishes, and answer when it is known what became of it; ``{"fault"}`` when it is denied."""
        request = self.begin(message, who)
        await request.ended.wait()
        found = request.describe()
        return {"fault": request.detail} if request.state is CommandState.DENIED else found

    def begin(self, message: Mapping[str, Any], who: str) -> TrackedCommand:
        """The request of a wish: the one that its ``id`` has already, or a new one that is on its way."""
        command_request = parse_request(message)
        if isinstance(command_request, str):
            return self._deny(CommandRequest("", "", "", {}, 0.0), who, command_request)
        first = self._known.get(command_request.key)
        if first and not first.command_request.is_same(command_request):
            return self._deny(command_request, who, f"id {command_request.key!r} is that of another command")
        return first or self._start(command_request, who)

    def recent(self) -> list[dict[str, Any]]:
        """The last requests, oldest first, as ``TrackedCommand.describe`` has them."""
        return [request.describe() for request in list(self._known.values())[-RECENT_COUNT:]]

    def _start(self, command_request: CommandRequest, who: str) -> TrackedCommand:
        try:
            if self._closed:
                raise CommandDenied(self._closed)
            if (
                sum(request.command_request.device == command_request.device for request in self._open.values())
                >= MAX_OPEN
            ):
                raise CommandDenied(f"{command_request.device}: {MAX_OPEN} commands wait for their end")
            plan = self.catalogue.plan(command_request.device, command_request.command, command_request.args)
        except CommandDenied as error:
            return self._remember(self._deny(command_request, who, str(error)))
        self._number += 1
        request = TrackedCommand(command_request, self._number, who, self._clock.now_ns(), plan.data, plan.answered)
        self._open[request.number] = self._remember(request)
        self._tell("info", f"{request.title()} for {who}: {plan.data.hex()}")
        self._hand_over(request, plan.link)
        return request

    def _hand_over(self, request: TrackedCommand, link: str) -> None:
        until_ns = request.t_ns + round(request.command_request.timeout_s * SECOND_NS)
        order = {"id": request.number, "link": link, "data": request.data.hex(), "until_ns": until_ns}
        if self._send({"send": order}):
            self._arm(request, request.command_request.timeout_s + CONFIRMATION_MARGIN_S)
            self._changed(request.describe())
        else:
            self._end(request, CommandState.NOT_SENT, "the recorder is being started again")

    def _deny(self, command_request: CommandRequest, who: str, why: str) -> TrackedCommand:
        """A request that has ended before it began; it has no number."""
        request = TrackedCommand(command_request, 0, who, self._clock.now_ns(), b"", answered=False)
        request.end(CommandState.DENIED, why)
        self._tell("warning", f"not sent for {who}: {why}")
        self._changed(request.describe())
        return request

    def _remember(self, request: TrackedCommand) -> TrackedCommand:
        self._known[request.command_request.key] = request
        if len(self._known) > MAX_REMEMBERED:
            del self._known[next(key for key, old in self._known.items() if old.ended.is_set())]
        return request

    # -------------------------------------------------------------------------------------------- what became of it

    def on_sent(self, message: Mapping[str, Any]) -> None:
        """The recorder says that it has sent a command, or why not.  message : id, fault, partly, t_ns"""
        request = self._open.get(message["id"])
        if request is None:
            return
        if message["fault"]:
            self._end(request, CommandState.UNKNOWN if message["partly"] else CommandState.NOT_SENT, message["fault"])
        elif not request.answered:
            request.sent_ns = message["t_ns"]
            self._end(request, CommandState.SENT, "the device does not acknowledge it")
        else:
            request.state, request.sent_ns = CommandState.WAITING, message["t_ns"]
            self._arm(request, request.command_request.timeout_s)
            self._changed(request.describe())
            self._handle_early_answers(request)

    def on_ack(self, ack: Mapping[str, Any]) -> None:
        """A device has answered.  ack : device, command ("" when it does not say which), accepted, detail, t_ns"""
        asked = [r for r in self._open.values() if r.answered and r.matches_answer(ack, MARGIN_NS)]
        sent = [request for request in asked if request.state is CommandState.WAITING]
        if sent:
            self._settle(sent[0], ack)
        elif asked:
            asked[0].early.append(ack)
            if len(asked[0].early) > MAX_EARLY_ANSWERS:
                self._unexpected.tell(asked[0].early.pop(0))
        else:
            self._report_unexpected(ack)

    def _report_unexpected(self, ack: Mapping[str, Any]) -> None:
        """No command waits for this answer."""
        late = next((r for r in self._lately_given_up() if r.matches_answer(ack, MARGIN_NS)), None)
        if late:
            self._given_up.remove(late)
            self._tell("warning", f"{late.title()}: answered late, {late.describe_answer(ack)}")
        elif not (ack["accepted"] and self.catalogue.is_polled(ack["device"])):
            self._unexpected.tell(ack)

    def _settle(self, request: TrackedCommand, ack: Mapping[str, Any]) -> None:
        request.answered_ns = ack["t_ns"]
        detail = str(ack["detail"])
        doubted = [r.number for r in self._lately_given_up() if r.matches_answer(ack, MARGIN_NS)]
        if doubted:
            doubt = f"it may be the late answer to {doubted[0]}"
            detail = f"{detail}; {doubt}" if detail else doubt
        self._end(request, CommandState.ACKNOWLEDGED if ack["accepted"] else CommandState.REFUSED, detail)

    def _lately_given_up(self) -> list[TrackedCommand]:
        now = self._clock.now_ns()
        return [r for r in self._given_up if now - r.t_ns < LATE_NS + round(r.command_request.timeout_s * SECOND_NS)]

    def on_child_ended(self, name: str) -> None:
        """The recorder or navigation has ended, and is started again: what it had not said yet is not known."""
        for request in list(self._open.values()):
            request.delay_causes.append(f"the {name} was started again meanwhile")
            if name == RECORDER and request.early:
                self._settle(request, request.early.pop())
            elif name == RECORDER and request.state is CommandState.SENDING:
                self._end(request, CommandState.UNKNOWN, "the recorder ended before it had said whether it was sent")

    def close(self) -> None:
        """The session ends: nothing is sent any more, and no answer is waited for."""
        self._closed = "the session is ending; nothing is sent any more"
        for request in list(self._open.values()):
            said = "sent, but" if request.state is CommandState.WAITING else "handed to the recorder, but"
            self._end(request, CommandState.UNKNOWN, f"{said} the session ended before an answer came")

    def _arm(self, request: TrackedCommand, seconds: float) -> None:
        request.disarm()
        request.timer = asyncio.get_running_loop().call_later(seconds, self._expire, request)

    def _expire(self, request: TrackedCommand) -> None:
        reasons = [*dict.fromkeys(request.delay_causes), self._delay_reason()]
        excuse = "".join(f"; {reason}" for reason in reasons if reason)
        patience = f"within {request.command_request.timeout_s:g} s"
        if request.early:
            self._settle(request, request.early.pop())
        elif request.state is CommandState.WAITING:
            self._end(request, CommandState.TIMED_OUT, f"no answer {patience}{excuse}")
        else:
            self._end(request, CommandState.UNKNOWN, f"the recorder has not said {patience} that it was sent{excuse}")

    def _end(self, request: TrackedCommand, state: CommandState, detail: str) -> None:
        if self._open.pop(request.number, None) is None:
            return  # an answer that was held for another one has ended it
        request.end(state, detail)
        if request.answered and state in (CommandState.TIMED_OUT, CommandState.UNKNOWN):
            self._given_up.append(request)
        self._tell(state.level, f"{request.title()}: {request.outcome()}")
        self._changed(request.describe())
        self._handle_early_answers(request)

    def _handle_early_answers(self, request: TrackedCommand) -> None:
        """The answers that came before it was known that it was sent: to it, or to something else."""
        for early in request.take_early_answers():
            self.on_ack(early)


class UnexpectedAnswers:
    """Answers that nobody waits for: to what is sent at each connect, or what another program has asked."""

    def __init__(self, clock: Clock, tell: ReportEvent) -> None:
        self._clock, self._tell = clock, tell
        self._reported_ns: deque[int] = deque(maxlen=MAX_UNEXPECTED)
        self._suppressed = 0

    def tell(self, ack: Mapping[str, Any]) -> None:
        """Make an event of it, unless there were too many; those are counted with the next one."""
        now = self._clock.now_ns()
        if len(self._reported_ns) == MAX_UNEXPECTED and now - self._reported_ns[0] < UNEXPECTED_PERIOD_NS:
            self._suppressed += 1
            return
        self._reported_ns.append(now)
        what = f"{ack['device']}: {'acknowledged' if ack['accepted'] else 'refused'} {ack['command'] or 'something'}"
        detail = f" ({ack['detail']})" if ack["detail"] else ""
        others = f"; so did {self._suppressed} answers before it" if self._suppressed else ""
        self._suppressed = 0
        self._tell("info" if ack["accepted"] else "warning", f"{what}{detail}, which no command waits for{others}")
