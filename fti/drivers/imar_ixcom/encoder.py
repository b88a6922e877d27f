"""The emulated device: measurements to frames, commands to responses."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable
from typing import Any

from fti.drivers import Counters
from fti.drivers._framing import Framer
from fti.drivers.imar_ixcom import commands, environment_messages, inertial, satellites, solution, system_status
from fti.drivers.imar_ixcom.commands import RESPONSE, RESPONSES
from fti.drivers.imar_ixcom.deviations import EKFSTDDEV, ITEMS
from fti.drivers.imar_ixcom.encoder_state import EncoderState
from fti.drivers.imar_ixcom.generic_values import encode_generic_values
from fti.drivers.imar_ixcom.options import CHANNELS, NAMES, NUMBERS, Options
from fti.drivers.imar_ixcom.status import ALIGNMENT, QUALITY, encode_status
from fti.drivers.imar_ixcom.wire import FRAME_MAX, IxcomFrame, encode_frame, measure, read_frame
from fti.formats.device_time import device_time_ns
from fti.messages.measurements import (
    Airspeed,
    Attitude,
    DeviceStatus,
    ImuSample,
    MagneticField,
    Measurement,
    Position,
    Reading,
    Satellites,
    Stamp,
    TimeScale,
    Velocity,
)

Make = Callable[[Any, EncoderState], bytes]


def _inssol(position: Position, encoder_state: EncoderState) -> bytes:
    now = position.stamp
    return solution.encode_inssol(
        encoder_state.get(ImuSample, now), encoder_state.get(Attitude, now), encoder_state.get(Velocity, now), position
    )


def _wheeldata(reading: Reading, encoder_state: EncoderState) -> bytes:
    speed, pulses = encode_generic_values(environment_messages.WHEEL, encoder_state.readings)
    return environment_messages.WHEELDATA.pack(speed, round(pulses))


def _extheight(reading: Reading, encoder_state: EncoderState) -> bytes:
    time, sd, height = encode_generic_values(environment_messages.HEIGHT, encoder_state.readings)
    return environment_messages.encode_extheight(height, sd, time)


#: Measurement, or last Reading, that completes a message -> names and payload functions.
BY_MEASUREMENT: dict[type, tuple[tuple[str, Make], ...]] = {
    ImuSample: (("IMURAW", lambda m, _: inertial.encode_imu(m)), ("IMUCORR", lambda m, _: inertial.encode_imu(m))),
    Attitude: (("INSRPY", lambda m, _: solution.encode_rpy(m)),),
    Velocity: (
        ("INSVELNED", lambda m, _: solution.encode_ned(m)),
        ("INSVELENU", lambda m, _: solution.encode_enu(m)),
        ("INSGNDSPEED", lambda m, _: solution.encode_gndspeed(m)),
    ),
    Position: (("INSSOL", _inssol), ("INSPOSLLH", lambda m, _: solution.encode_llh(m))),
    Airspeed: (("AIRDATA", environment_messages.encode_airdata),),
    MagneticField: (("MAGDATA", environment_messages.encode_magdata),),
    DeviceStatus: (("SYSSTAT", lambda _, encoder_state: system_status.encode_sysstat(encoder_state)),),
}
BY_READING: dict[str, tuple[str, Make]] = {
    ITEMS[-1].name: ("EKFSTDDEV", lambda _, state: EKFSTDDEV.pack(*encode_generic_values(ITEMS, state.readings))),
    inertial.GRAVITY_FREE[-1].name: (
        "IMUCOMP",
        lambda _, state: inertial.IMU.pack(*encode_generic_values(inertial.GRAVITY_FREE, state.readings)),
    ),
    environment_messages.WHEEL[-1].name: ("WHEELDATA", _wheeldata),
    environment_messages.HEIGHT[-1].name: ("EXTHEIGHT", _extheight),
}
#: Messages that can be requested even if the configuration does not name them.
ALWAYS = frozenset({
    "IMURAW", "IMUCORR", "INSSOL", "INSRPY", "INSVELNED", "INSVELENU", "INSGNDSPEED", "INSPOSLLH",
})  # fmt: skip


class Encoder:
    """The emulated system.

    A message is sent with the measurement that completes it, at most every ``divider``-th epoch; an epoch is a stamp.
    Position and Velocity after Satellites of the same stamp are those of the receiver, not of the system.
    """

    def __init__(self, options: Options) -> None:
        self._options = options
        self._encoder_state = EncoderState(options.magnetometer_unit)
        self._counters = Counter[str]()
        self._epoch = 0
        self._now: Stamp | None = None
        self._sent_at: dict[str, int] = {}
        self._open = not options.ask
        self._logs: dict[str, int] = {} if options.ask or options.only else dict(options.logs)
        self._framer = Framer(measure, Counters(), limit=FRAME_MAX)

    def encode(self, measurement: Measurement) -> list[bytes]:
        """See ``drivers.Encoder``."""
        stamp = measurement.stamp
        if stamp is not self._now and stamp != self._now:
            self._now, self._epoch = stamp, self._epoch + 1
        self._encoder_state.update(measurement)
        return [
            self._frame(name, measurement, make(measurement, self._encoder_state))
            for name, make in self._completed(measurement)
            if self._is_due(name)
        ]

    def _completed(self, m: Measurement) -> tuple[tuple[str, Make], ...]:
        kind = type(m)
        if type(m) is Reading:
            return (BY_READING[m.name],) if m.name in BY_READING else ()
        if (kind is Position or kind is Velocity) and self._encoder_state.get(Satellites, m.stamp):
            return (("GNSSSOL", satellites.encode_gnsssol),) if kind is Position else ()
        return BY_MEASUREMENT.get(kind, ())

    def _is_due(self, name: str) -> bool:
        divider = self._logs.get(name)
        if divider is None or not self._open:
            return False
        if divider > 1 and name in self._sent_at and self._epoch - self._sent_at[name] < divider:
            return False
        self._sent_at[name] = self._epoch
        return True

    def _frame(self, name: str, cause: Measurement, payload: bytes) -> bytes:
        t_gps_ns = device_time_ns(cause.stamp, TimeScale.GPS)
        counter, self._counters[name] = self._counters[name], self._counters[name] + 1
        return encode_frame(NUMBERS[name], counter, t_gps_ns, encode_status(self._flags(cause)), payload)

    def _flags(self, cause: Measurement) -> tuple[str, ...]:
        """Status flags of the footer, including invalid attitude and position."""
        flags = self._encoder_state.flags
        of_receiver = self._encoder_state.get(Satellites, cause.stamp) is not None
        attitude = cause if isinstance(cause, Attitude) else self._encoder_state.get(Attitude, cause.stamp)
        if attitude and not attitude.valid:
            flags = (*(f for f in flags if f not in ALIGNMENT), "aligning")
        if isinstance(cause, Position) and not cause.valid and not of_receiver:
            flags = (*(f for f in flags if f not in QUALITY), "position_undefined")
        return flags

    # ------------------------------------------------------------------------------------------------- commands

    def respond(self, data: bytes) -> list[bytes]:
        """Answer every command and parameter."""
        if self._options.only:
            return []
        frames = [read_frame(frame, 0) for _, frame in self._framer.feed(data, 0)]
        return [self._answer(f) for f in frames if f.number in (NUMBERS["COMMAND"], NUMBERS["PARAMETER"])]

    def _answer(self, frame: IxcomFrame) -> bytes:
        number = self._execute(frame.payload) if frame.number == NUMBERS["COMMAND"] else 0
        text = RESPONSES[number].encode()
        payload = RESPONSE.pack(number, len(text)) + text
        flags = self._encoder_state.flags if self._now else (*self._encoder_state.flags, "time_invalid")
        t_gps_ns = device_time_ns(self._now, TimeScale.GPS) if self._now else 0
        return encode_frame(NUMBERS["RESPONSE"], frame.counter, t_gps_ns, encode_status(flags), payload)

    def _execute(self, payload: bytes) -> int:
        """The number of the response to a command."""
        try:
            number, _ = struct.unpack_from("<HH", payload)
            if number == commands.LOG:
                return self._execute_log(*struct.unpack_from("<BBHH", payload, 4))
            if number == commands.XCOM:
                mode, channel = struct.unpack_from("<HH", payload, 4)
                if channel >= CHANNELS:
                    return RESPONSES.index("invalid channel")
                self._open = {commands.OPEN: True, commands.CLOSE: False}.get(mode, self._open)
                return 0
        except struct.error:
            return RESPONSES.index("invalid parameter")
        accepted = (commands.CONF, commands.EKF, commands.EXTAID)
        return 0 if number in accepted else RESPONSES.index("invalid command")

    def _execute_log(self, message: int, trigger: int, action: int, divider: int) -> int:
        name = NAMES.get(message, "")
        if action == commands.CLEAR_ALL:
            self._logs.clear()
        elif name not in ALWAYS and name not in self._options.logs:
            return RESPONSES.index("invalid log")
        elif action == commands.CLEAR:
            self._logs.pop(name, None)
        elif trigger != commands.POLLED:
            self._logs[name] = divider if trigger == commands.SYNCHRONOUS else 0
        return 0
