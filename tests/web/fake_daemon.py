"""A daemon that is not one: plays a plausible approach on the bus, for the tests of the page.

``python -m tests.web.fake_daemon --port 8080`` serves the page with it until Ctrl-C.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from msgspec.structs import asdict, replace

from fti.bus.client import Publisher
from fti.bus.message import encode, encode_with_age
from fti.clock import SystemClock, choose_epoch_ns
from fti.config import Config, Nav, Session
from fti.messages.outputs import (
    ClearanceIntegrity,
    Compensation,
    Event,
    FilterMode,
    FilterSolution,
    GlideSlope,
    GroundDrift,
    HeightAboveGround,
    HeightBelowAircraft,
    IntegrityState,
    NavSolution,
    Output,
    PositionFix,
    ProvisionalSolution,
    TerrainFix,
    VerticalSolution,
)
from fti.messages.reasons import Reason
from fti.messages.topics import BUS_ALARMS
from fti.nav.alarm_conditions import OutputConditions
from fti.service.supervisor.alarm_board import AlarmBoard
from tests.bus.running_hub import RunningHub

SESSION = "da42_20260412T093107_1"
#: Of the owner, as the supervisor makes it at each start.
KEY = "kQ7-owner_of_the_fake_daemon_Zx3vT9LmB2s"
MAX_AGE_MS = 500.0
PERIOD_S = 0.1
HEALTH_EVERY = 5
GLIDE_ANGLE = math.radians(3.0)
SPEED = 45.0  # m/s
START_S_M = 6500.0
DEG = math.pi / 180
PROVISIONAL, DRIFT = "/nav/provisional_solution/gnss", "/nav/ground_drift"

#: Roles of the fake daemon's devices.
CONFIG = Config(
    session=Session(name="fake"),
    nav=Nav(position=("ins",), attitude=("ins",), altimeters=("radar_altimeter", "laser_altimeter")),
)

Messages = dict[str, dict[str, Any]]


class Approach:
    """The outputs of a three-degree approach over rolling ground, at a time [s] since its start."""

    def __init__(self, seed: int = 7) -> None:
        self._random = random.Random(seed)

    def outputs(self, t: float, t_ns: int) -> dict[str, Output]:
        """Topic to output."""
        s = max(START_S_M - SPEED * t, 200.0)
        dh = 9.0 * math.sin(t / 13.0) + 3.0 * math.sin(t / 4.1)
        roll = 2.4 * math.sin(t / 5.0) * DEG
        agl = s * math.tan(GLIDE_ANGLE) + dh + 14.0 * math.sin(s / 310.0) + 6.0 * math.sin(s / 90.0)
        common: dict[str, Any] = {"t_ns": t_ns, "t_valid_ns": t_ns - 20_000_000, "reasons": (), "valid": True}
        return {
            "/nav/height_above_ground/radar_altimeter": self._height("radar_altimeter", agl, 1.2, common),
            "/nav/height_above_ground/laser_altimeter": self._laser(agl, roll, common),
            "/nav/height_below_aircraft": HeightBelowAircraft(
                sensor="radar_altimeter", height_agl=agl, sd=1.2, compensation=Compensation.BEAM, **common
            ),
            "/nav/clearance_integrity": self._integrity(t, s, dh, common),
            "/nav/glide_slope": self._glide(s, dh, common),
            "/nav/nav_solution": self._solution(t, s, dh, roll, common),
            **self._fallbacks(common),
        }

    def _height(self, sensor: str, agl: float, sd: float, common: dict[str, Any]) -> HeightAboveGround:
        height = agl + self._random.gauss(0.0, sd / 3)
        ground: dict[str, Any] = {"nearest": height - 1.5, "nearest_sd": sd / 2, "predicted": height * 1.004 + 1.2}
        return HeightAboveGround(sensor=sensor, raw=height * 1.004 + 0.3, height_agl=height, sd=sd, **ground, **common)

    def _laser(self, agl: float, roll: float, common: dict[str, Any]) -> HeightAboveGround:
        if agl > 300.0:
            lost = {**common, "valid": False, "reasons": (Reason.ABOVE_RANGE, Reason.NO_RETURN)}
            return HeightAboveGround(sensor="laser_altimeter", raw=None, height_agl=None, sd=None, **lost)
        return self._height("laser_altimeter", agl / math.cos(roll), 0.2, {**common, "unchecked": (Reason.UNCERTAIN,)})

    def _integrity(self, t: float, s: float, dh: float, common: dict[str, Any]) -> ClearanceIntegrity:
        state = IntegrityState.ACQUIRE if t < 6.0 else IntegrityState.MONITOR if t % 40 < 8 else IntegrityState.OK
        if state is IntegrityState.ACQUIRE:
            return ClearanceIntegrity(state=state, **{**common, "valid": False}, reference="5e4f0a1b77c2")
        reasons = (Reason.NOT_OBSERVABLE,) if state is IntegrityState.MONITOR else ()
        tests = {
            f"t{i}_ratio": abs(0.35 + 0.2 * math.sin(t / (3.0 + i)) + self._random.gauss(0, 0.02)) for i in range(1, 5)
        }
        return ClearanceIntegrity(
            **{**common, "reasons": reasons},
            **(tests if state is IntegrityState.OK else {**tests, "t2_ratio": None}),
            state=state,
            shift=4.0 * math.sin(t / 9.0),
            shift_sd=5.0,
            height_error=0.5 + 0.05 * dh,
            height_error_sd=0.9,
            observability=22.0 + 6.0 * math.sin(t / 11.0),
            s_begin=s + 400.0,
            s_end=s,
            alert_limit_v=max(5.0, math.tan(0.35 * DEG) * s),
            alert_limit_s=50.0,
            protection_level_v=9.4,
            protection_level_s=31.0,
            reference="5e4f0a1b77c2",
        )

    def _glide(self, s: float, dh: float, common: dict[str, Any]) -> GlideSlope:
        deviation = math.atan2(s * math.tan(GLIDE_ANGLE) + dh, s) - GLIDE_ANGLE
        dots = deviation / (0.12 * GLIDE_ANGLE)
        return GlideSlope(
            **common,
            s=s,
            y=8.0 * math.sin(s / 700.0),
            dh=dh,
            dh_sd=1.2,
            dh_nav=dh + 0.6,
            deviation=deviation,
            sd=1.2 / s,
            dots=max(-2.0, min(2.0, dots)),
            clamped=abs(dots) > 2,
        )

    @staticmethod
    def _fallbacks(common: dict[str, Any]) -> dict[str, Output]:
        gone = {**common, "valid": False, "t_valid_ns": None, "reasons": (Reason.NO_DME, Reason.GEOMETRY)}
        filtered = FilterSolution(mode=FilterMode.AIDED, horizontal_sd=2.3, alt=640.0, vertical_sd=1.2, **common)
        return {
            "/nav/filter_solution": filtered,
            "/nav/vertical_solution": VerticalSolution(alt=640.0, vertical_sd=1.2, **common),
            "/nav/position_fix": PositionFix(**gone),
            "/nav/terrain_fix": TerrainFix(
                lat=0.64,
                lon=-1.47,
                north_sd=3.1,
                east_sd=4.6,
                correlation=0.1,
                shift_north=-12.0,
                shift_east=5.0,
                reach=150.0,
                samples=74,
                length=902.0,
                is_search=False,
                unchecked=(Reason.MAP_UNVERIFIED,),
                **common,
            ),
            DRIFT: GroundDrift(
                interval=1.9,
                directions=3,
                north=0.3,
                east=-0.4,
                down=0.1,
                north_sd=0.04,
                east_sd=0.06,
                down_sd=0.01,
                overlap=0.48,
                points=5625,
                pairs=41,
                refused=8,
                **common,
            ),
            PROVISIONAL: ProvisionalSolution(
                source="gnss",
                quantities=("position", "height", "velocity"),
                horizontal_sd=1.8,
                distance=103.8,
                height_difference=-1.2,
                hpl=154.4,
                vpl=18.7,
                readmission="a step back that cancels it, or fti readmit",
                **{**common, "valid": False, "reasons": (Reason.UNCONFIRMED,)},
            ),
        }

    def _solution(self, t: float, s: float, dh: float, roll: float, common: dict[str, Any]) -> NavSolution:
        return NavSolution(
            **common,
            position_source="ins",
            attitude_source="ins",
            lat=47.0632 * DEG,
            lon=(11.2012 + s / 76000.0) * DEG,
            alt=630.0 + s * math.tan(GLIDE_ANGLE) + dh,
            horizontal_sd=1.5,
            vertical_sd=2.1,
            hpl=15.2,
            vpl=20.4,
            tilt_pl=0.42 * DEG,
            heading_pl=6.38 * DEG,
            attitude_valid=True,
            vel_north=3.1,
            vel_east=-44.8,
            vel_down=2.36 + 0.3 * math.sin(t / 4),
            roll=roll,
            pitch=(-1.2 + 0.8 * math.sin(t / 6.0)) * DEG,
            heading=(268.0 + 2.0 * math.sin(t / 8.0)) * DEG,
        )


def _link(kind: str, t: float, rate: float, size: int, **changes: Any) -> dict[str, Any]:
    return {
        "kind": kind,
        "state": "good",
        "hint": "",
        "bytes": int(t * rate * size),
        "frames": int(t * rate),
        "rate_hz": rate,
        "age_ms": 500.0 / rate if rate else None,
        "dropped_frames": 0,
        "dropped_bytes": 0,
        "tx_frames": 0,
        "load": {"receive": 0.02, "global": 0.08 + 0.06 * math.sin(t), "write": 0.11},
    } | changes


def _device(link: str, driver: str, t: float, rate: float, **changes: Any) -> dict[str, Any]:
    return {
        "link": link,
        "driver": driver,
        "state": "good",
        "hint": "",
        "messages": int(t * rate),
        "rate_hz": rate,
        "age_ms": 500.0 / rate if rate else None,
        "bytes_in": 0,
        "framed": 0,
        "held": 0,
        "skipped": {},
    } | changes


def make_clock(scale: str, offset_ms: float, **changes: Any) -> dict[str, Any]:
    """A device's clock as health has it; without changes one that is known and used."""
    return {
        "scale": scale,
        "state": "good",
        "used": True,
        "offset_ms": offset_ms,
        "offset_sd_ms": 0.042,
        "drift_ppm": 1.1,
        "drift_sd_ppm": 0.021,
        "late_share": 0.0125,
        "messages": 4000,
        "refused": 3,
    } | changes


def make_health(t: float, t_ns: int, started_ns: int) -> dict[str, Any]:
    """The health of a bench with one cable that does not fit and one that is not plugged in."""
    noise = {"state": "noise", "hint": "bytes but no frame: check baud rate and inversion; freeflight_ra4500 was seen"}
    absent = {"state": "absent", "hint": "/dev/ttyUSB3 does not exist; there are ttyUSB0, ttyUSB1", "rate_hz": None}
    running = {"state": "running", "pid": 4242, "restarts": 0}
    return {
        "t_ns": t_ns,
        "session": {
            "name": SESSION,
            "folder": f"/data/{SESSION}",
            "origin": "hil",
            "started_ns": started_ns,
            "state": "recording",
        },
        "processes": {name: dict(running) for name in ("recorder", "navigation", "display")},
        "links": {
            "ins_eth": _link("udp", t, 100.0, 96),
            "radalt_line": _link("serial", t, 25.0, 9),
            "laser_line": _link("serial", t, 30.0, 14),
            "airdata_can": _link("can", t, 240.0, 16, load={"receive": 0.31, "global": 0.62, "write": 0.4}),
            "arinc_line": _link("serial", t, 61.3, 5, **noise),
            "gnss_line": _link("serial", t, 0.0, 0, **absent),
        },
        "devices": {
            "ins": _device("ins_eth", "imar_ixcom", t, 100.0, clocks=[make_clock("gps", -213.4567)]),
            "radar_altimeter": _device("radalt_line", "freeflight_ra4500", t, 25.0),
            "laser_altimeter": _device("laser_line", "nmea0183", t, 30.0),
            "air_data": _device("airdata_can", "canaerospace", t, 60.0),
            "arinc": _device("arinc_line", "arinc429", t, 0.0, **noise, skipped={"bad_parity": 1840}),
            "gnss": _device("gnss_line", "nmea0183", t, 0.0, state="absent", hint="link is absent", rate_hz=None),
        },
        "storage": {
            "file": f"/data/{SESSION}/{SESSION}_000.mcap",
            "file_bytes": int(2_000_000 + t * 15_000),
            "file_age_s": t,
            "free_mb": 118_400.0,
            "state": "ok",
            "hint": "",
        },
        "navigation": {
            "lag_ms": 11.0 + 3 * math.sin(t),
            "output_delay": {"p50_ms": 9.2, "p99_ms": 17.4, "max_ms": 22.1},
            "ring_lost_frames": 0,
            "last_seq": int(t * 450),
        },
    }


def make_sinks() -> dict[str, Any]:
    """Health of three sinks, of which one has no connection and has lost events."""
    counts = {"connects": 1, "sent": 41_234, "replaced": 0, "skipped": 120, "waiting_events": 0, "lost_events": 0}
    lost = {**counts, "replaced": 12_034, "waiting_events": 4096, "lost_events": 17}
    fault = "publish.mqtt: ground.example.org:8883: [Errno 111] Connection refused"
    return {
        "mqtt": {"state": "retrying", "hint": fault, "peers": None, **lost},
        "foxglove": {"state": "connected", "hint": "", "peers": 2, **counts},
        "nmea": {"state": "connected", "hint": "", "peers": 0, **counts},
    }


def make_laboratory(t: float, **states: str) -> dict[str, Any]:
    """Message of an emulator of that bench; states : of breakers that are not on."""
    rates = {
        "ins": 100.0,
        "radar_altimeter": 25.0,
        "laser_altimeter": 9.0,
        "air_data": 10.0,
        "arinc": 12.5,
        "gnss": 5.0,
    }
    devices = {
        name: {"link": f"{name}_line", "asked_hz": rate, "messages": int(t * rate), "breaker": "on", "faults": []}
        for name, rate in rates.items()
    }
    fog = {"kind": "fog", "words": "fog, 75 m", "on": ["laser_altimeter"], "until_s": 96.0}
    devices["laser_altimeter"]["faults"] = ["fog"]
    for name, state in states.items():
        devices[name]["breaker"] = state
    devices["pdu"] = devices["gnss"] | {"breaker": None}
    return {
        "scenario": "Fog over the threshold",
        "flight_s": t,
        "duration_s": 240.0,
        "devices": devices,
        "links": {},
        "faults": [fog],
        "supply_v": 28.0,
        "lateness": {"messages": int(t * 161), "p50_ms": 0.07, "p99_ms": 0.9, "max_ms": 6.4},
        "holds": True,
        "not_held": [],
    }


EVENTS = (
    (0.2, "info", "supervisor", "session started"),
    (0.9, "info", "navigation", "ready; kernels compiled in 1.6 s"),
    (1.5, "warning", "gnss_line", "absent: /dev/ttyUSB3 does not exist"),
    (2.1, "warning", "arinc_line", "bytes but no frame: check baud rate and inversion"),
    (6.0, "info", "integrity", "acquire -> ok"),
)


def _as_output(output: Output, fields: dict[str, Any]) -> Output:
    """The output with changed fields."""
    changed = {name: fields[name] for name in fields if fields[name] != getattr(output, name)}
    for name in ("reasons", "unchecked", "attitude_reasons", "attitude_unchecked"):
        if name in changed:
            changed[name] = tuple(map(Reason, changed[name]))
    if "state" in changed:
        changed["state"] = IntegrityState(changed["state"])
    return replace(output, **changed)


class FakeDaemon:
    """Publishes outputs at 10 Hz and health at 2 Hz from a thread, through a hub of its own.

    muted : topics that are not sent; at first those of an unconfirmed source and of the drift
    change_health, change_integrity : may rewrite each message
    changes : fields of outputs that are other ones, by topic
    breakers : states of those that are not on, while an emulator plays the sensors; None: there is none
    alarms : what keeps its alarms, as the supervisor does
    lead_s : how much of the approach has been flown at the start; path : of the socket, None for a temporary one
    """

    def __init__(self, lead_s: float = 0.0, path: Path | None = None) -> None:
        self._running = RunningHub(path)
        self.hub = self._running.hub
        self.muted: set[str] = {PROVISIONAL, DRIFT}
        self.change_health: Callable[[dict[str, Any]], None] = lambda health: None
        self.change_integrity: Callable[[dict[str, Any]], dict[str, Any]] = lambda fields: fields
        self.changes: dict[str, dict[str, Any]] = {}
        self.breakers: dict[str, str] | None = None
        self._navigation: Publisher | None = None
        self._lead_s = lead_s
        self._approach = Approach()
        self._events = list(EVENTS)
        self._conditions = OutputConditions(CONFIG)
        self.alarms = AlarmBoard(
            SystemClock(choose_epoch_ns()), self.hub.publish, lambda *_: None, oldest_waiting_ns=lambda: None
        )
        self.alarms._health.start_new_flight(2**62)  # what is absent is expected
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fake daemon")
        self._started_ns = time.time_ns() - round(lead_s * 1e9)

    def start(self) -> None:
        """Begin to publish; the lead goes first, so that a display that listens has its plots full."""
        self._navigation = Publisher(self.hub.path, "navigation")
        for i in range(round(self._lead_s / PERIOD_S)):
            self._send_outputs(i * PERIOD_S)
        self._thread.start()

    def stop_navigation(self) -> None:
        """End navigation as if it were killed: its token is removed and its messages stop."""
        navigation, self._navigation = self._navigation, None
        if navigation:
            navigation.close()

    def publish_event(self, level: str, source: str, text: str) -> None:
        """Publish an event that happens now."""
        self.hub.publish("/event", encode(asdict(Event(t_ns=time.time_ns(), level=level, source=source, text=text))))

    def close(self) -> None:
        """End everything."""
        self._ending.set()
        self._thread.join()
        self.stop_navigation()
        self._running.close()

    def _run(self) -> None:
        begin = time.monotonic()
        for i in range(10**9):
            t = self._lead_s + i * PERIOD_S
            self._send_outputs(t)
            self._send_events(t)
            if i % HEALTH_EVERY == 0:
                self._send_health(t)
                self._send_laboratory(t)
            if self._ending.wait(max(0.0, begin + (i + 1) * PERIOD_S - time.monotonic())):
                return

    def _send_outputs(self, t: float) -> None:
        navigation = self._navigation
        t_ns = self._started_ns + round(t * 1e9)
        for topic, output in self._approach.outputs(t, t_ns).items():
            fields = asdict(output)
            if topic == "/nav/clearance_integrity":
                fields = self.change_integrity(fields)
            fields |= self.changes.get(topic, {})
            if navigation and topic not in self.muted:
                navigation.publish(topic, encode_with_age(fields, t_ns, t_ns + 4_000_000, MAX_AGE_MS))
            if navigation and not self.muted & {topic, BUS_ALARMS}:
                for report in self._conditions.feed((_as_output(output, fields),)):
                    self.alarms.handle_report(report.as_record())

    def _send_events(self, t: float) -> None:
        while self._events and self._events[0][0] <= t:
            at, level, source, text = self._events.pop(0)
            event = Event(t_ns=self._started_ns + round(at * 1e9), level=level, source=source, text=text)
            self.hub.publish("/event", encode(asdict(event)))

    def _send_health(self, t: float) -> None:
        health = make_health(t, self._started_ns + round(t * 1e9), self._started_ns)
        if self._navigation is None:
            health["processes"]["navigation"]["state"] = "restarting"
        self.change_health(health)
        if "/health" not in self.muted:
            self.hub.publish("/health", encode(health))
        if not self.muted & {"/health", BUS_ALARMS}:
            self.alarms.handle_health(health)

    def _send_laboratory(self, t: float) -> None:
        if self.breakers is not None:
            self.hub.publish("/hil", encode_with_age(make_laboratory(t, **self.breakers), 0, 1_000_000, 1500.0))


class DisplayProcess:
    """The real display process on the bus of a fake daemon, started as the supervisor starts it.

    url : of the page for everybody; owner_url : with the key to command from it
    """

    def __init__(self, daemon: FakeDaemon, port: int = 0) -> None:
        self.control, theirs = socket.socketpair()
        fd = str(theirs.fileno())
        where = ["--bus", str(daemon.hub.path), "--port", str(port), "--control-fd", fd]
        command = [sys.executable, "-m", "fti.service.display", *where]
        self.process = subprocess.Popen(command, pass_fds=[theirs.fileno()], start_new_session=True)
        theirs.close()
        self.send("PageKey", key=KEY)
        self.port = self._read_port()
        self.url = f"http://127.0.0.1:{self.port}/"
        self.owner_url = f"{self.url}#key={KEY}"

    def _read_port(self) -> int:
        self.control.settimeout(20.0)
        message = self.read_message()
        if not message:
            self.control.close()
            raise ConnectionError(f"the display ended with code {self.process.wait(10.0)}")
        return int(message["PagePort"]["port"])

    def read_message(self) -> dict[str, Any]:
        """Next message of the display to its supervisor; empty at its end."""
        with self.control.makefile() as lines:
            content: dict[str, Any] = json.loads(lines.readline() or "{}")
        return content

    def send(self, name: str, **fields: Any) -> None:
        """Send it a message, as its supervisor does."""
        self.control.sendall(json.dumps({name: fields}).encode() + b"\n")

    def close(self) -> int:
        """Close the control channel, as at the end of its supervisor; returns the exit code."""
        self.control.close()
        try:
            self.process.wait(10.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        return int(self.process.returncode)


def main() -> None:
    """Serve the page with the fake approach until Ctrl-C."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=0)
    daemon = FakeDaemon(lead_s=70.0)
    display = DisplayProcess(daemon, parser.parse_args().port)
    daemon.start()
    print(display.owner_url, flush=True)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        display.close()
        daemon.close()


if __name__ == "__main__":
    main()
