"""Small recorded sessions for the tests of the commands that read them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import SessionFolder
from fti.messages.measurements import Attitude, ImuSample, Stamp
from fti.messages.outputs import Event, GlideSlope
from fti.messages.reasons import Reason

STARTED = 1_767_323_045_000_000_000
SECOND = 1_000_000_000
LINKS = [RawTopic("ins", "udp", {}), RawTopic("radar", "serial", {})]
ABOUT = {"name": "s", "origin": "hil", "software": "0.1.0", "config_sha256": "5e4f0a1b77c2" + 52 * "0"}
CONFIG = b"""
[[device]]
name = "ins"
link = "ins"
driver = "imar_ixcom"
rate_hz = 25
"""


def make_folder(tmp_path: Path) -> SessionFolder:
    """The folder of a session."""
    return SessionFolder.create(tmp_path, "s", STARTED)


def record_raw(
    folder: SessionFolder, seqs: range, skip: Callable[[int], bool] = lambda seq: False, split_s: float = 4
) -> RawLog:
    """Frames of 10 bytes at 50 Hz, in turn of the links radar and ins; the log is left open."""
    log = RawLog(
        folder,
        LINKS,
        LogSettings(
            split_s=split_s, split_mb=100, metadata={"fti": ABOUT}, attachments=[("config.toml", "text/plain", CONFIG)]
        ),
    )
    for seq in seqs:
        t_ns = STARTED + seq * SECOND // 50
        if not skip(seq):
            log.write_frame("ins" if seq % 2 else "radar", seq, t_ns, bytes(10))
        if seq % 50 == 49:
            log.flush()
    log.flush()
    return log


def record_snapshots(folder: SessionFolder, *parts: range) -> None:
    """A session in mode "snapshot" of 6 s: ticks in the raw file, frames of some numbers in a snapshot file each."""
    settings = LogSettings(
        split_s=300,
        split_mb=100,
        metadata={"fti": {**ABOUT, "mode": "snapshot"}},
        attachments=[("config.toml", "text/plain", CONFIG)],
    )
    log = RawLog(folder, LINKS, settings)
    for seq in range(0, 300, 10):
        log.write_tick(seq, STARTED + seq * SECOND // 50)
    mark(log, 2.0, "flutter")
    log.close()
    for part in parts:
        shot = RawLog(folder, LINKS, settings, kind="snapshot")
        for seq in (seq for seq in part if seq % 10):
            shot.write_frame("ins" if seq % 2 else "radar", seq, STARTED + seq * SECOND // 50, bytes(10))
        shot.close()


def mark(log: RawLog, t_s: float, text: str) -> None:
    """A mark at a time after the start of the session."""
    t_ns = STARTED + round(t_s * SECOND)
    log.write_json("/fti/event", t_ns, Event(t_ns=t_ns, level="info", source="mark", text=text))


def record_derived(folder: SessionFolder) -> None:
    """Two inertial samples, the first unknown; a glide slope with reasons; an attitude."""
    log = DerivedLog(folder, LogSettings(split_s=300, split_mb=100))
    log.write_measurement("imu", ImuSample(stamp=Stamp(STARTED)))
    log.write_measurement("imu", ImuSample(stamp=Stamp(STARTED + SECOND), accel_b=(0.1, -0.2, 9.81)))
    log.write_measurement("ins", Attitude(stamp=Stamp(STARTED + SECOND), roll=0.01, valid=True))
    reasons = (Reason.ROLL, Reason.STALE)
    log.write_output(GlideSlope(t_ns=STARTED, t_valid_ns=None, valid=False, reasons=reasons, deviation=1e-3))
    log.close()
