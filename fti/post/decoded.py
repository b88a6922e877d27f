"""Every measurement of a session, decoded again from its frames by the decode chain of the flight.

The times of validity are those of the flight: the device clocks are reset where navigation was started again, and
where the operator readmitted all sources.  Frames that navigation missed are decoded too; after such frames a time of
validity may differ from that of the flight by the error of the estimated clock.  The clocks in a snapshot are estimated
from its frames alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from fti.config import Config
from fti.devices import BoundDevice, bind_devices
from fti.errors import RecordingError
from fti.logger.export.measurements import DecodedFrame
from fti.logger.reading.json_message import parse_table, using_message, whole_number
from fti.logger.reading.recording import FileFault, Recording
from fti.messages.frames import ALL_SOURCES
from fti.messages.topics import GAP_TOPIC, READMISSION_TOPIC
from fti.post.reprocess import attached_config, infrequent_gc
from fti.service.navigation.decode_chain import MeasurementChain


@dataclass(frozen=True, slots=True)
class DecodedRecording:
    """The devices of a session with frames, and their measurements."""

    recording: Recording
    config: Config
    bound: list[BoundDevice]

    @classmethod
    def open(cls, recording: Recording) -> DecodedRecording:
        """Raises RecordingError without frames or a configuration, ConfigError where that is invalid."""
        if not recording.frame_files:
            raise RecordingError(f"{recording.path}: contains no frames")
        config, texts = attached_config(recording.attachments(), recording.path)
        return cls(recording, config, bind_devices(config, texts))

    @property
    def devices(self) -> dict[str, int]:
        """Maximum age of the values of each device [ns], by its name."""
        return {device.name: round(device.max_age_ms * 1e6) for device in self.config.device}

    def measurements(self, is_wanted: Callable[[str], bool]) -> Iterator[DecodedFrame]:
        """Each frame with its measurements, of the devices that are wanted.

        A frame with a wrong number ends it; it is a fault of the recording.
        """
        chain = MeasurementChain(self.config, [bound for bound in self.bound if is_wanted(bound.device.name)])
        resets = iter([*sorted(self._clock_resets()), float("inf")])
        reset = next(resets)
        try:
            with infrequent_gc():
                for frame in self.recording.frames():
                    while frame.seq >= reset:
                        chain.reset_clocks()
                        reset = next(resets)
                    yield frame, chain.feed(frame).measurements
        except RecordingError as error:
            self.recording.faults[self.recording.path] = FileFault(self.recording.path, str(error))

    def _clock_resets(self) -> Iterator[int]:
        """Numbers of the frames before which navigation knew nothing of the device clocks."""
        for topic, t_ns, _, _, data in self.recording.messages("/fti/"):
            if topic not in (GAP_TOPIC, READMISSION_TOPIC):
                continue
            with using_message(topic, t_ns):
                note = parse_table(data)
                if note.get("kind") == "restart":
                    yield whole_number(note["before_seq"])
                elif note.get("source") == ALL_SOURCES:
                    yield whole_number(note["after_seq"]) + 1
