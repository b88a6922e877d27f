"""Health: the states of links, devices, storage, navigation and processes.

Recorder and navigation report their parts to the supervisor, which composes the record.
"""

from __future__ import annotations

from dataclasses import dataclass

from fti.messages.ledger import LinkFrameAccount
from fti.messages.tables import ABSENT, Absent
from fti.messages.units import (
    Bytes,
    Count,
    Hertz,
    Megabytes,
    Milliseconds,
    Nanoseconds,
    PartsPerMillion,
    Ratio,
    Seconds,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionHealth:
    """The session.

    state       : recording, waiting (for the first file), storage_error, stopping
    accelerated : flights in memory have it, and no mode
    """

    name: str
    folder: str
    origin: str
    mode: str | Absent = ABSENT
    started_ns: Nanoseconds
    state: str
    accelerated: str | Absent = ABSENT


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessHealth:
    """A process of the daemon.  pid : None while it does not run;  restarts : since the start of the session"""

    state: str
    pid: Count | None
    restarts: Count


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkHealth:
    """A link.  Flights in memory have no more than its state and its counts.

    state, hint  : of its best device while the port is good, otherwise of the port;  port_state : of the port
    dropped_*    : by the buffers and, frames only, by the kernel
    echo_bytes   : received bytes that were the echo of sent ones
    load         : fill of the buffer queues receive, global and write, 1: full
    """

    kind: str
    state: str
    hint: str
    frames: Count
    bytes: Bytes
    rate_hz: Hertz | Absent = ABSENT
    age_ms: Milliseconds | Absent | None = ABSENT
    connects: Count | Absent = ABSENT
    stamp_refused: Count | Absent = ABSENT
    dropped_frames: Count | Absent = ABSENT
    dropped_bytes: Bytes | Absent = ABSENT
    tx_frames: Count | Absent = ABSENT
    echo_bytes: Bytes | Absent = ABSENT
    load: dict[str, Ratio] | Absent = ABSENT
    ledger: LinkFrameAccount | Absent = ABSENT
    port_state: str | Absent = ABSENT


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockHealth:
    """The clock of a device.

    offset_ms  : device - FTI time; GPS time is converted to UTC
    drift_ppm  : relative to FTI time, positive: faster
    late_share : share of messages with more than the usual delay, since the clock was learnt
    refused    : messages that did not fit the clock
    used       : validity times are taken from it (``use_device_time``)
    """

    scale: str
    state: str
    used: bool
    offset_ms: Milliseconds
    offset_sd_ms: Milliseconds | None
    drift_ppm: PartsPerMillion | None
    drift_sd_ppm: PartsPerMillion | None
    late_share: Ratio
    messages: Count
    refused: Count


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceHealth:
    """A device, as navigation decodes it.

    is_known : enough frames were processed to know that it is silent
    rate_hz  : of its most frequent message
    framed, held, skipped : bytes in messages, waiting for the rest of one, and skipped by reason
    """

    link: str
    driver: str
    state: str
    hint: str
    is_known: bool
    messages: Count
    rate_hz: Hertz
    age_ms: Milliseconds | None
    bytes_in: Bytes
    framed: Bytes
    held: Bytes
    skipped: dict[str, Bytes]
    clocks: tuple[ClockHealth, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class StorageHealth:
    """The storage; empty until the recorder has reported it.

    file, file_bytes, file_age_s : present file, its size, and the time since its last write
    """

    file: str | Absent | None = ABSENT
    file_bytes: Bytes | Absent = ABSENT
    file_age_s: Seconds | Absent | None = ABSENT
    free_mb: Megabytes | Absent | None = ABSENT
    state: str | Absent = ABSENT
    hint: str | Absent = ABSENT


@dataclass(frozen=True, slots=True, kw_only=True)
class SnapshotHealth:
    """The snapshot.  state : waiting, writing;  held_s, held_mb : content of its memory;  file : the last one"""

    state: str
    held_s: Seconds
    held_mb: Megabytes
    file: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputDelay:
    """Delay of outputs, from the timestamp of a frame to the publication of its last output."""

    p50_ms: Milliseconds
    p99_ms: Milliseconds
    max_ms: Milliseconds


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationHealth:
    """Navigation; empty until it has reported.

    lag_ms       : age of the newest processed frame
    output_delay : over the last 5 s; None without outputs
    derived_lost, derived_fault : lost messages of the derived file, and why it cannot be written
    hint         : why there is no present report
    """

    lag_ms: Milliseconds | Absent = ABSENT
    output_delay: OutputDelay | Absent | None = ABSENT
    ring_lost_frames: Count | Absent = ABSENT
    last_seq: Count | Absent = ABSENT
    terrain: str | Absent | None = ABSENT
    is_terrain_loading: bool | Absent = ABSENT
    derived_lost: Count | Absent = ABSENT
    bus_lost: Count | Absent = ABSENT
    derived_fault: str | Absent | None = ABSENT
    hint: str | Absent = ABSENT


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthRecord:
    """Health of the daemon.

    complete, since_ns : as in the ledger, for links, devices and processes; of an entry that is not in a record only
                         age_ms has grown with the time
    """

    t_ns: Nanoseconds
    session: SessionHealth
    processes: dict[str, ProcessHealth]
    links: dict[str, LinkHealth]
    devices: dict[str, DeviceHealth]
    storage: StorageHealth
    snapshot: SnapshotHealth | None
    navigation: NavigationHealth
    complete: bool | Absent = ABSENT
    since_ns: Nanoseconds | Absent = ABSENT
