"""Real-time settings of the recorder: CPU affinity, scheduler, locked memory, garbage collector.

All are off by default.  Before anything is created, each setting is tried: affinity and scheduler belong to a thread,
so a temporary thread tries them.

With ``scheduler = "fifo"`` the reader runs before every ordinary process, and the other threads of the recorder run
one priority below it.  With an ordinary priority, a thread that holds the interpreter lock while it waits for a
processor would block the reader.  With the same or a higher priority, compression and checksums would delay a
timestamp.  A runaway thread cannot starve the machine: the interpreter lock keeps the recorder on one processor at a
time, and the kernel reserves a part of every second for others.  If that reserve is off, ``fifo`` is refused.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import mmap
import os
import resource
import threading
from collections.abc import Callable
from pathlib import Path

from fti.config import Config, RecorderTuning
from fti.errors import ConfigError

MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4
#: Sufficient limit of locked memory, without the memory of the snapshot sink [B].
MIN_LOCKED_LIMIT_BYTES = 2**30
#: Share of each period that ``fifo`` threads may use [us]; -1 : all of it.
RT_RUNTIME_PATH = Path("/proc/sys/kernel/sched_rt_runtime_us")


def check(config: Config) -> None:
    """Raises ConfigError when the machine does not permit what ``[recorder]`` asks for."""
    tuning = config.recorder
    _check_cpus(config.path, tuning.cpu)
    if tuning.scheduler == "fifo" and (refusal := _try_change(lambda: _set_fifo(tuning.priority))):
        raise ConfigError(
            f"{config.path}: recorder.scheduler = 'fifo' with recorder.priority = {tuning.priority}: not permitted "
            f"({refusal}); allowed here is 'other'; CAP_SYS_NICE or a limit of at least {tuning.priority} permits it "
            f"(systemd: AmbientCapabilities=CAP_SYS_NICE or LimitRTPRIO={tuning.priority})"
        )
    if tuning.scheduler == "fifo" and _is_unbounded():
        raise ConfigError(
            f"{config.path}: recorder.scheduler = 'fifo': such a process could occupy a processor completely "
            f"({RT_RUNTIME_PATH} is -1); allowed here is 'other', or set kernel.sched_rt_runtime_us = 950000"
        )
    if tuning.lock_memory and not _may_lock(config):
        raise ConfigError(
            f"{config.path}: recorder.lock_memory = true: not permitted (the limit is "
            f"{resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] // 1024} KiB); allowed here is false; CAP_IPC_LOCK or no "
            "limit permits it (systemd: AmbientCapabilities=CAP_IPC_LOCK or LimitMEMLOCK=infinity)"
        )


def _is_unbounded() -> bool:
    try:
        return int(RT_RUNTIME_PATH.read_text()) < 0
    except OSError:
        return False  # a container that hides it


def _check_cpus(path: str, cpus: tuple[int, ...]) -> None:
    for index, cpu in enumerate(cpus):
        if _try_change(lambda cpu=cpu: os.sched_setaffinity(0, {cpu})):  # type: ignore[misc]
            allowed = ", ".join(str(c) for c in sorted(os.sched_getaffinity(0)))
            raise ConfigError(
                f"{path}: recorder.cpu[{index}] = {cpu}: processor not available; allowed are {allowed} "
                "(systemd: AllowedCPUs, CPUAffinity)"
            )


def _try_change(change: Callable[[], None]) -> str | None:
    """Try a change in a temporary thread; returns why it is refused, or None."""
    refusals: list[str] = []

    def attempt() -> None:
        try:
            change()
        except (OSError, OverflowError) as error:
            refusals.append(getattr(error, "strerror", None) or str(error))

    thread = threading.Thread(target=attempt, name="trial")
    thread.start()
    thread.join()
    return refusals[0] if refusals else None


def _may_lock(config: Config) -> bool:
    """Lock one page more than the limit allows, to see whether the limit applies to this process."""
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    needed = MIN_LOCKED_LIMIT_BYTES + round(config.snapshot.max_mb * 2**20 if config.snapshot else 0)
    if limit == resource.RLIM_INFINITY or limit >= needed:
        return True
    size = limit + mmap.PAGESIZE
    with contextlib.closing(mmap.mmap(-1, size)) as area:
        start = ctypes.c_char.from_buffer(area)
        allowed: bool = _libc().mlock(ctypes.c_void_p(ctypes.addressof(start)), ctypes.c_size_t(size)) == 0
        del start
    return allowed


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


# --------------------------------------------------------------------------------------------------- in the recorder


def apply(tuning: RecorderTuning) -> list[str]:
    """Apply the settings to the calling thread (the reader) and its later threads.  Returns refused settings."""
    steps: list[Callable[[], None]] = []
    if tuning.cpu:
        steps.append(lambda: os.sched_setaffinity(0, tuning.cpu))
    if tuning.lock_memory:
        steps.append(_lock_memory)
    if tuning.freeze_gc:
        steps.append(gc.disable)
    if tuning.scheduler == "fifo":
        steps.append(lambda: _set_fifo(tuning.priority))
    refused = []
    for step in steps:
        try:
            step()
        except OSError as error:
            refused.append(f"[recorder]: {error.strerror or error}")
    return refused


def _set_fifo(priority: int) -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


def step_below_reader() -> None:
    """First step of every other thread, which was started with the priority of the reader."""
    if os.sched_getscheduler(0) == os.SCHED_FIFO:
        with contextlib.suppress(OSError):  # the priority of the reader is acceptable
            _set_fifo(os.sched_getparam(0).sched_priority - 1)


def _lock_memory() -> None:
    """Lock present pages now, and later pages at their first use."""
    for flags in (MCL_CURRENT, MCL_FUTURE | MCL_ONFAULT):
        if _libc().mlockall(flags) != 0:
            number = ctypes.get_errno()
            raise OSError(number, f"mlockall: {os.strerror(number)}")
