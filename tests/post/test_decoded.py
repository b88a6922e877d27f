"""Measurements decoded again: the times of validity follow what navigation knew of the device clocks."""

from __future__ import annotations

from datetime import UTC, datetime
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Any

import pytest

from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.post.decoded import DecodedRecording
from tests.small_config import LINE, device

CONFIG = LINE + device("gnss", "nmea0183", rate_hz=5)
START_NS = 1_700_000_000_000_000_000
PERIOD_NS, MESSAGES, RESET = 200_000_000, 300, 200
#: Arrival after the time in the message: the odd ones are late [ns].
DELAYS_NS = (20_000_000, 23_000_000)


def time_message(n: int) -> bytes:
    """ZDA with the time of message n."""
    t_s, rest_ns = divmod(START_NS + n * PERIOD_NS, 10**9)
    text = f"GNZDA,{datetime.fromtimestamp(t_s, UTC):%H%M%S}.{rest_ns // 10**7:02d},14,11,2023,00,00"
    return f"${text}*{reduce(xor, text.encode()):02X}\r\n".encode()


def record(folder: Path, notes: list[tuple[str, dict[str, Any]]]) -> Recording:
    session = SessionFolder.create(folder, "small", START_NS)
    attachments = [("config.toml", "text/plain", CONFIG.encode())]
    log = RawLog(
        session, [RawTopic("line", "serial", {})], LogSettings(split_s=600, split_mb=10, attachments=attachments)
    )
    for n in range(MESSAGES):
        log.write_frame("line", n, START_NS + n * PERIOD_NS + DELAYS_NS[n % 2], time_message(n))
    log.close()
    derived = DerivedLog(session, LogSettings(split_s=600, split_mb=10))
    for topic, note in notes:
        derived.write_table(topic, START_NS, {"t_ns": START_NS, **note})
    derived.close()
    return Recording.open(session.path)


def lateness_of_validity(recording: Recording) -> list[int]:
    """Time of validity minus the time in the message, less that of the first message [ns]."""
    decoded = DecodedRecording.open(recording).measurements(lambda name: name == "gnss")
    stamps = [m.stamp for _, found in decoded for _, m in found]
    assert len(stamps) == MESSAGES
    return [(stamp.t_valid_ns or 0) - START_NS - n * PERIOD_NS - DELAYS_NS[0] for n, stamp in enumerate(stamps)]


@pytest.mark.parametrize(
    "note",
    [
        ("/fti/gap", {"kind": "restart", "after_seq": RESET - 1, "before_seq": RESET}),
        ("/fti/readmission", {"source": "*", "after_seq": RESET - 1}),
    ],
    ids=["restart", "readmission"],
)
def test_the_clocks_are_learned_anew_where_navigation_did(tmp_path: Path, note: tuple[str, dict[str, Any]]) -> None:
    """By the arrival the odd messages are 3 ms late; by the clock none is."""
    late = lateness_of_validity(record(tmp_path, [note]))
    by_arrival = [delay - DELAYS_NS[0] for delay in DELAYS_NS]
    assert late[:2] == by_arrival and late[RESET : RESET + 2] == by_arrival
    assert max(map(abs, late[RESET - 20 : RESET])) < 1_000_000 and max(map(abs, late[-20:])) < 1_000_000


def test_other_gaps_and_readmissions_change_no_clock(tmp_path: Path) -> None:
    notes: list[tuple[str, dict[str, Any]]] = [
        ("/fti/gap", {"kind": "ring", "after_seq": RESET - 1, "before_seq": RESET + 1}),
        ("/fti/readmission", {"source": "gnss", "after_seq": RESET - 1}),
    ]
    late = lateness_of_validity(record(tmp_path, notes))
    assert max(map(abs, late[RESET - 20 :])) < 1_000_000


def test_a_number_that_occurs_twice_ends_the_measurements_and_is_a_fault(tmp_path: Path) -> None:
    recording = record(tmp_path, [])
    settings = LogSettings(split_s=600, split_mb=10)
    log = RawLog(SessionFolder(recording.path), [RawTopic("line", "serial", {})], settings)
    log.write_frame("line", MESSAGES // 2, START_NS, b"other")
    log.close()
    recording = Recording.open(recording.path)
    frames = list(DecodedRecording.open(recording).measurements(lambda name: True))
    assert len(frames) == MESSAGES
    assert "occurs twice" in recording.faults[recording.path].text
