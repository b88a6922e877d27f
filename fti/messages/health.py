"""Health: the states of links, devices, storage, navigation and processes.

Recorder and navigation report their parts to the supervisor, which composes the record.
"""

from __future__ import annotations

from msgspec import UNSET, UnsetType

from fti.messages.ledger import LinkFrameAccount
from fti.messages.tables import Message
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


class SessionHealth(Message, kw_only=True):
    """The session.

    state       : recording, waiting (for the first file), storage_error, stopping, stopped
    accelerated : flights in memory have it, and no mode
    """

    name: str
    folder: str
    origin: str
    mode: str | UnsetType = UNSET
    started_ns: Nanoseconds
    state: str
    accelerated: str | UnsetType = UNSET


class ProcessHealth(Message, kw_only=True):
    """A process of the daemon.  pid : None while it does not run;  restarts : since the start of the session"""

    state: str
    pid: Count | None
    restarts: Count


class LinkHealth(Message, kw_only=True):
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
    rate_hz: Hertz | UnsetType = UNSET
    age_ms: Milliseconds | UnsetType | None = UNSET
    connects: Count | UnsetType = UNSET
    stamp_refused: Count | UnsetType = UNSET
    dropped_frames: Count | UnsetType = UNSET
    dropped_bytes: Bytes | UnsetType = UNSET
    tx_frames: Count | UnsetType = UNSET
    echo_bytes: Bytes | UnsetType = UNSET
    load: dict[str, Ratio] | UnsetType = UNSET
    ledger: LinkFrameAccount | UnsetType = UNSET
    port_state: str | UnsetType = UNSET


class ClockHealth(Message, kw_only=True):
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


class DeviceHealth(Message, kw_only=True):
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


class StorageHealth(Message, kw_only=True):
    """The storage; empty until the recorder has reported it.

    file, file_bytes, file_age_s : present file, its size, and the time since its last write
    """

    file: str | UnsetType | None = UNSET
    file_bytes: Bytes | UnsetType = UNSET
    file_age_s: Seconds | UnsetType | None = UNSET
    free_mb: Megabytes | UnsetType | None = UNSET
    state: str | UnsetType = UNSET
    hint: str | UnsetType = UNSET


class SnapshotHealth(Message, kw_only=True):
    """The snapshot.  state : waiting, writing;  held_s, held_mb : content of its memory;  file : the last one"""

    state: str
    held_s: Seconds
    held_mb: Megabytes
    file: str | None


class OutputDelay(Message, kw_only=True):
    """Delay of outputs, from the timestamp of a frame to the publication of its last output."""

    p50_ms: Milliseconds
    p99_ms: Milliseconds
    max_ms: Milliseconds


class NavigationHealth(Message, kw_only=True):
    """Navigation; empty until it has reported.

    lag_ms       : age of the newest processed frame
    output_delay : over the last 5 s; None without outputs
    derived_lost, derived_fault : lost messages of the derived file, and why it cannot be written
    hint         : why there is no present report
    """

    lag_ms: Milliseconds | UnsetType = UNSET
    output_delay: OutputDelay | UnsetType | None = UNSET
    ring_lost_frames: Count | UnsetType = UNSET
    last_seq: Count | UnsetType = UNSET
    terrain: str | UnsetType | None = UNSET
    is_terrain_loading: bool | UnsetType = UNSET
    derived_lost: Count | UnsetType = UNSET
    bus_lost: Count | UnsetType = UNSET
    derived_fault: str | UnsetType | None = UNSET
    hint: str | UnsetType = UNSET


class SinkHealth(Message, kw_only=True):
    """A sink of ``[publish]``.

    state  : connecting, connected, retrying after a failure, or silent: its process does not report
    hint   : the failure
    peers  : connected peers; None without a connection, and for protocols without one
    connects : number of connections
    sent   : messages that were sent
    replaced : values that a newer one replaced because the sink was slow or not connected
    skipped  : values that the configured rate left out
    waiting_events, lost_events : events in the queue, and those that were dropped because it was full
    """

    state: str
    hint: str
    peers: Count | None
    connects: Count
    sent: Count
    replaced: Count
    skipped: Count
    waiting_events: Count
    lost_events: Count


class HealthRecord(Message, kw_only=True):
    """Health of the daemon.

    sinks      : by the name of the sink in the configuration; absent without [publish]
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
    sinks: dict[str, SinkHealth] | UnsetType = UNSET
    complete: bool | UnsetType = UNSET
    since_ns: Nanoseconds | UnsetType = UNSET
