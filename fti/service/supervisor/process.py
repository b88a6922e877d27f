"""The supervisor: starts and monitors the other processes, publishes health, events and alarms.

It opens no device and decodes nothing.  Shutdown sequence: sending stops, kernel queues are drained, readers stop,
buffers are written, raw file closed, ring ended (all in the recorder); navigation empties the ring and closes the
derived file; the display ends; the supervisor ends.  A second interrupt shortens only the steps after the raw file.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fti import run_directory
from fti.alarms.condition import Condition, Severity
from fti.buffers.ring import Ring, ring_size
from fti.bus.frame import SOCKET_NAME
from fti.bus.hub import Hub
from fti.bus.loopback import choose_port, describe_endpoint
from fti.clock import SystemClock, describe_wrong_time
from fti.config import Config, Publish
from fti.messages import control
from fti.messages.frames import ALL_SOURCES
from fti.messages.notes import AlarmReportRecord
from fti.messages.outputs import Event
from fti.messages.refusals import CarriedRefusal
from fti.messages.tables import to_table
from fti.service import control_channel
from fti.service.children import Child, ProcessState
from fti.service.fault_guard import catch_failures
from fti.service.supervisor import child_shutdown
from fti.service.supervisor.alarm_board import NO_FRAME_TAKEN, AlarmBoard
from fti.service.supervisor.bus_thread import hub_thread
from fti.service.supervisor.child_monitor import ChildMonitor, RecorderOutbox
from fti.service.supervisor.command_catalogue import CommandCatalogue
from fti.service.supervisor.command_tracker import CommandTracker
from fti.service.supervisor.control_socket import serve_commands
from fti.service.supervisor.event_publisher import Announce, EventPublisher
from fti.service.supervisor.health import HealthBoard
from fti.service.supervisor.operator_requests import OperatorRequests
from fti.service.supervisor.page_access import PageAccess
from fti.service.supervisor.session_result import SessionResult, save_ledger
from fti.service.supervisor.session_storage import FileNumbers, SessionStorage
from fti.service.supervisor.shutdown import SessionShutdown
from fti.service.supervisor.startup_checks import ValidatedConfig
from fti.service.supervisor.watchdog import Watchdog
from fti.service.terrain_retry import TerrainRetry

HEALTH_PERIOD_S = 0.5
LATENESS_PERIOD_S = 0.1
MAX_STARTS = 2
RECORDER = "recorder"
NAVIGATION = "navigation"
DISPLAY = "display"
ZENOH = "zenoh"
PUBLISH = "publish"


class Supervisor:
    """One session of the daemon.

    recorder  : the child that was spawned before the configuration was read; announce : shows a line to the user
    shows_key : the announced address of the page has the command key
    failed    : the recorder could not start; loss : after ``run``: description of the lost data, or None
    """

    def __init__(
        self,
        config: Config,
        epoch_ns: int,
        run_dir: str | None,
        recorder: Child,
        announce: Announce,
        *,
        shows_key: bool = False,
    ) -> None:
        self._config = config
        self._clock = SystemClock(epoch_ns)
        self._announce = announce
        self._validated_config = ValidatedConfig(config, epoch_ns)
        self._loop = asyncio.get_running_loop()
        self._stop = asyncio.Event()
        self.recording_started = asyncio.Event()
        self.failed = False
        self.loss: str | None = None
        self.display_ready, self.navigation_ready = asyncio.Event(), asyncio.Event()
        self._page = PageAccess(config.display.address, shows_key=shows_key)
        self._zenoh_port = choose_port(config.bus.port) if config.bus.enabled else None
        self._run_dir = run_directory.make(config.session.name, run_dir)
        self._hub = Hub(self._run_dir.path / SOCKET_NAME, self._warn_of_bus)
        self._session_storage = SessionStorage(config.session, self._clock.now_ns(), announce)
        self.folder = self._session_storage.folder
        self._ring = Ring.create(ring_size(config.link))
        self._children = self._make_children(recorder)
        self._board = HealthBoard(self._describe_session())
        self._recorder_report: control.RecorderReport | None = None
        self._outbox = RecorderOutbox(recorder)
        self._file_numbers = FileNumbers()
        self._result = SessionResult()
        self._terrain_retry = TerrainRetry()
        self._without_terrain: str | None = None
        self._refusals: tuple[CarriedRefusal, ...] = ()  # of sources by navigation
        self._event_publisher = EventPublisher(self._clock, self._hub.publish, announce, self._outbox.add_note)
        self._alarms = AlarmBoard(self._clock, self._hub.publish, self._outbox.add_note, self._oldest_waiting_ns)
        self._command_tracker = self._make_command_tracker()
        self._operator_requests = OperatorRequests(
            config,
            self._clock,
            command_tracker=self._command_tracker,
            outbox=self._outbox,
            event_publisher=self._event_publisher,
            send_to_display=self._send_to_display,
            send_to_navigation=self._send_to_navigation,
            alarms=self._alarms,
        )
        self._child_monitor = ChildMonitor(
            self._children,
            on_message=self._on_message,
            on_start=self._on_start,
            on_exit=self._on_exit,
            report=self._event_publisher.report,
        )
        self._handlers = self._make_handlers()
        self._watchdog = self._make_watchdog(recorder)
        self._shutdown = SessionShutdown(
            self._children, self._child_monitor, self._ring, self._session_storage, announce
        )

    def _describe_session(self) -> dict[str, Any]:
        session = self._config.session
        return {
            "name": session.name,
            "folder": str(self.folder.path),
            "origin": session.origin,
            "mode": session.mode,
            "started_ns": self._clock.now_ns(),
            "state": "recording",
        }

    def _make_command_tracker(self) -> CommandTracker:
        return CommandTracker(
            CommandCatalogue(self._config, self._validated_config.devices),
            self._clock,
            send=self._outbox.send,
            report_event=lambda level, text: self._event_publisher.publish_event(level, "command", text),
            changed=self._send_to_display,
            delay_reason=self._board.answer_delay_reason,
        )

    def _make_watchdog(self, recorder: Child) -> Watchdog:
        return Watchdog(
            recorder,
            self._outbox,
            progress=lambda: self._ring.next_seq,
            report_event=self._event_publisher.publish_event,
            is_ending=lambda: self._child_monitor.stopping,
            report=self._event_publisher.report,
        )

    def _make_children(self, recorder: Child) -> list[Child]:
        config, targets, bus = self._config, self._session_storage.all, self._hub.path
        recorder.startup, recorder.ring_fds = self._validated_config.recorder_startup(targets), self._ring.fds
        children = [
            recorder,
            Child(NAVIGATION, self._validated_config.navigation_startup(targets, bus), self._ring.fds),
        ]
        if config.display.enabled:
            children.append(Child(DISPLAY, arguments=("--bus", str(bus), "--port", str(config.display.port))))
        if self._zenoh_port is not None:
            where = ("--bus", str(bus), "--session", config.session.name, "--port", str(self._zenoh_port))
            children.append(Child(ZENOH, arguments=(*where, "--epoch-ns", str(self._clock.epoch_ns))))
        if config.publish is not None:
            children.append(Child(PUBLISH, arguments=self._publish_arguments(config.publish)))
        return children

    def _publish_arguments(self, publish: Publish) -> tuple[str, ...]:
        return (
            *("--bus", str(self._hub.path), "--epoch-ns", str(self._clock.epoch_ns)),
            *("--aircraft", publish.aircraft or self._config.session.name, "--session", self.folder.name),
            *("--table", publish.model_dump_json()),
        )

    def _warn_of_bus(self, text: str) -> None:
        """Called by the thread of the hub."""
        self._loop.call_soon_threadsafe(self._event_publisher.publish_event, "warning", "bus", text)

    def _child(self, name: str) -> Child | None:
        return next((child for child in self._children if child.name == name), None)

    # ------------------------------------------------------------------------------------------------ running

    @property
    def run_dir(self) -> Path:
        """Path where ``watch``, ``mark``, ``send`` and ``page`` find this daemon."""
        return self._run_dir.path

    def stop(self) -> None:
        """End the session; a second call shortens the steps after the raw file."""
        (self._shutdown.hurry_requested if self._stop.is_set() else self._stop).set()

    def suppress_sensor_alarms(self) -> None:
        """Suppress sensor alarms until ``resume_sensor_alarms``: the caller starts or has stopped the sensors."""
        self._alarms.suppress_device_alarms()
        self._event_publisher.set_sensors_off(True)

    def resume_sensor_alarms(self) -> None:
        """The sensors run: a silent one is an alarm after the usual time."""
        self._alarms.resume_device_alarms()
        self._event_publisher.set_sensors_off(False)

    def expect_end(self) -> None:
        """Suppress alarms at the end: the sensors stop before the session."""
        self._alarms.end()
        self._event_publisher.set_sensors_off(True)

    async def readmit_all(self, who: str) -> None:
        """Reset navigation for a new flight."""
        await self._operator_requests.handle_command({"readmit": ALL_SOURCES}, who)

    async def run(self, duration_s: float | None = None) -> None:
        """Record until stopped, or for a duration [s] from the start of the recording."""
        try:
            commands = await serve_commands(
                self._run_dir.bind(), self._operator_requests.handle_command, self._event_publisher.report
            )
            with contextlib.closing(commands), hub_thread(self._hub, self._warn_of_bus):
                await self._record(duration_s)
        finally:
            self._run_dir.withdraw()
            await asyncio.to_thread(self._shutdown.close_own_files, self._board.recorder.get("storage", {}))
            self._ring.close()

    async def _record(self, duration_s: float | None) -> None:
        if wrong := describe_wrong_time():
            self._event_publisher.publish_event("warning", "clock", wrong)
        self._child_monitor.start(self._children[0])
        monitoring = asyncio.create_task(self._child_monitor.watch(), name="watch")
        watchdog = asyncio.create_task(self._watchdog.run(), name="watchdog")
        publishing = asyncio.create_task(self._publish_health(), name="health")
        checking = asyncio.create_task(self._check_navigation_latency(), name="lateness")
        closing = asyncio.create_task(
            self._shutdown.close_killed_sessions(self.recording_started, self._event_publisher), name="repair"
        )
        try:
            await self._wait_for_end(duration_s)
        finally:
            await self._end()
            await self._finish_repair(closing)
            await self._cancel(monitoring, watchdog, publishing, checking)

    async def _wait_for_end(self, duration_s: float | None) -> None:
        stopping = asyncio.create_task(self._stop.wait(), name="stop")
        recording = asyncio.create_task(self.recording_started.wait(), name="recording")
        await asyncio.wait([stopping, recording], return_when=asyncio.FIRST_COMPLETED)
        await asyncio.wait([stopping], timeout=duration_s)
        await self._cancel(stopping, recording)

    async def _cancel(self, *tasks: asyncio.Task[Any]) -> None:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _on_start(self, child: Child) -> None:
        if child.name == RECORDER:
            self._outbox.resume()
        elif child.name == DISPLAY:
            self._send_to_display(control.PageKey(self._page.key))

    def _on_exit(self, child: Child, code: int) -> None:
        if self._child_monitor.stopping:
            return
        if child.name in (RECORDER, NAVIGATION):
            self._command_tracker.on_child_ended(child.name)
        if child.name == RECORDER:
            self._alarms.on_recorder_replaced(child_shutdown.describe_restart(child, code))
            self._result.add_killed_recorder(self._recorder_report)
            numbers = self._file_numbers
            child.startup = self._validated_config.recorder_startup(
                self._session_storage.all, numbers.next, numbers.skipped_numbers
            )
        if child.name == NAVIGATION:
            self._without_terrain = self._terrain_retry.on_exit() or self._without_terrain
            child.startup = self._validated_config.navigation_startup(
                self._session_storage.all, self._hub.path, self._without_terrain, self._refusals
            )
        if child.name == DISPLAY:
            self._page.forget()
            self._publish_info()
        self._event_publisher.publish_event("error", child.name, child_shutdown.describe_restart(child, code))
        if child.name == RECORDER and not self.recording_started.is_set() and child.restarts >= MAX_STARTS:
            self.failed = True  # a recorder that cannot start is the only failure without retry
            self.stop()

    def _make_handlers(self) -> dict[type, Callable[[Any], object]]:
        """What is done with each message of a child; ``Ready`` is handled by ``_on_message``."""
        requests, tracker = self._operator_requests, self._command_tracker
        return {
            control.FileNumber: self._file_numbers.handle_report,
            control.RecorderReport: self._on_recorder_report,
            control.NavigationReport: self._on_navigation_report,
            control.PublishReport: self._on_publish_report,
            control.ClockStepNotice: self._on_clock_step,
            control.SendResult: tracker.on_sent,
            control.DeviceAnswer: tracker.on_ack,
            control.RecorderEnd: self._on_recorder_end,
            Event: self._event_publisher.forward_event,
            control.TerrainLoading: self._terrain_retry.on_loading,
            control.Refusals: self._on_refusals,
            AlarmReportRecord: self._alarms.handle_report,
            control.PagePort: self._on_page_port,
            control.PageFault: lambda message: self._event_publisher.publish_event("error", DISPLAY, message.text),
            **dict.fromkeys(
                (control.PageMark, control.PageCommand, control.PageAcknowledgement), requests.on_page_message
            ),
        }

    def _on_message(self, child: Child, message: control.FromChild) -> None:
        if isinstance(message, control.Ready | control.PagePort):
            self._on_ready(child, message.fault if isinstance(message, control.Ready) else None)
        if handle := self._handlers.get(type(message)):
            handle(message)

    def _on_recorder_report(self, report: control.RecorderReport) -> None:
        self._recorder_report, self._board.recorder = report, to_table(report)

    def _on_navigation_report(self, report: control.NavigationReport) -> None:
        self._board.navigation = to_table(report)

    def _on_publish_report(self, report: control.PublishReport) -> None:
        self._board.sinks = to_table(report)["sinks"]

    def _on_clock_step(self, notice: control.ClockStepNotice) -> None:
        self._alarms.record(Condition("clock_step", Severity.CAUTION, "COMPUTER CLOCK STEPPED", notice.text))

    def _on_recorder_end(self, end: control.RecorderEnd) -> None:
        self._result.handle_report(end)
        self._shutdown.recorded.set()

    def _on_refusals(self, message: control.Refusals) -> None:
        self._refusals = message.refusals

    def _on_page_port(self, message: control.PagePort) -> None:
        self._page.on_port(message.port)
        self._announce(self._page.announcement)
        self._publish_info()
        self.display_ready.set()
        self._operator_requests.send_commands_to_display()

    def _send_to_display(self, message: control.ToDisplay) -> None:
        display = self._child(DISPLAY)
        if display and display.channel:
            display.channel.send(message)

    def _send_to_navigation(self, message: control.ToNavigation) -> bool:
        navigation = self._child(NAVIGATION)
        return bool(navigation and navigation.channel and navigation.channel.send(message))

    def _on_ready(self, child: Child, fault: str | None) -> None:
        child.state = ProcessState.RUNNING
        if child.name == NAVIGATION:
            self.navigation_ready.set()
        if child.name == RECORDER and fault and not self.recording_started.is_set():
            self._announce(f"error: storage: {fault}")
            self.failed = True
            self.stop()
        elif child.name == RECORDER and not self.recording_started.is_set():
            self.recording_started.set()
            self._announce(f"recording to {self.folder.path}")
            if self._config.session.mode == "snapshot":
                self._event_publisher.publish_event(
                    "warning", "session", "mode snapshot: frames are recorded on a trigger only"
                )
            self._publish_info()
            control_channel.notify_systemd("READY=1")
            for other in self._children[1:]:
                self._child_monitor.start(other)

    def _publish_info(self) -> None:
        info = run_directory.DaemonInfo(
            pid=os.getpid(),
            name=self._config.session.name,
            session=str(self.folder.path),
            display=self._page.url,
            page=self._page.owner_url,
            zenoh=None if self._zenoh_port is None else describe_endpoint(self._zenoh_port),
            epoch_ns=self._clock.epoch_ns,
            sock=str(self._run_dir.control_socket),
        )
        self._run_dir.publish(info)

    async def _publish_health(self) -> None:
        cycle = 0
        while True:
            with catch_failures("health", self._event_publisher.report):
                health = self._board.compose(self._clock.now_ns(), self._children)
                self._event_publisher.health(health, record=cycle % 2 == 0)
                self._alarms.handle_health(health)
            cycle += 1
            await asyncio.sleep(HEALTH_PERIOD_S)

    def _oldest_waiting_ns(self) -> int | None:
        """Arrival time of the oldest frame that navigation has not finished [ns]."""
        return self._ring.oldest_waiting_ns if self._ring.reader_state().position else NO_FRAME_TAKEN

    async def _check_navigation_latency(self) -> None:
        while not self._child_monitor.stopping:
            with catch_failures("alarms", self._event_publisher.report):
                self._alarms.check_navigation_latency()
            await asyncio.sleep(LATENESS_PERIOD_S)

    async def _end(self) -> None:
        self._command_tracker.close()
        self._alarms.end()
        self._board.session["state"] = "stopping"
        await self._shutdown.end_recording()
        self._board.session["state"] = "stopped"
        self._event_publisher.health(self._board.compose(self._clock.now_ns(), self._children), record=False)
        await self._shutdown.end_display()
        self.loss = self._result.describe_loss(self.folder.path)
        if self.loss is None:
            self._announce(f"recorded {self.folder.path}")
        elif ledger := self._result.unrecorded_ledger:
            self._announce(save_ledger(ledger, self.folder.name, self._run_dir.path))

    async def _finish_repair(self, closing: asyncio.Task[None]) -> None:
        """Wait for the repair of old sessions; a hurried shutdown leaves further files to the next start."""
        if not self.recording_started.is_set():
            await self._cancel(closing)
        else:
            await closing
