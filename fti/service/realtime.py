"""What makes the machine prompt for the recorder: processors, scheduler, locked memory, no collector of cycles.

Everything is off by default.  What the machine does not permit is found out before anything is created, by trying it:
affinity and scheduler belong to a thread, so a thread that ends at once tries them.

With ``scheduler = "fifo"`` the reader runs before every ordinary process, and the other threads of the recorder one
below it.  They may not stay ordinary: one of them that waits for a processor while it holds the interpreter would hold
the reader, too.  They may not be above or beside it: packing and checksums must never delay a stamp.  Nor may they
starve the machine when one of them runs wild: the interpreter lock keeps the recorder on one processor at a time, and
there the kernel leaves a part of every second to the others.  Where that is switched off, ``fifo`` is refused.
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
#: A limit of locked memory that is never in the way, besides the memory of the snapshot sink [B].
MIN_LOCKED_LIMIT_BYTES = 2**30
#: Time of each period that the kernel leaves to threads under ``fifo`` [us]; -1 : all of it.
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
            f"{config.path}: recorder.scheduler = 'fifo': this machine lets such a process take all of a processor "
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
            there = ", ".join(str(c) for c in sorted(os.sched_getaffinity(0)))
            raise ConfigError(
                f"{path}: recorder.cpu[{index}] = {cpu}: there is no such processor for us; allowed are {there} "
                "(systemd: AllowedCPUs and CPUAffinity say which)"
            )


def _try_change(change: Callable[[], None]) -> str | None:
    """Why a change of the calling thread is refused; None when it is not.  Tried in a thread that ends with it."""
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
    """Locking one page more than the limit allows shows whether it holds for us."""
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
    """Do it, for the calling thread (the reader) and those that it will start.  Returns what was refused after all."""
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
    """For every other thread, as its first step: it was started with the priority of the reader."""
    if os.sched_getscheduler(0) == os.SCHED_FIFO:
        with contextlib.suppress(OSError):  # beside the reader is better than not at all
            _set_fifo(os.sched_getparam(0).sched_priority - 1)


def _lock_memory() -> None:
    """What there is now comes in and stays; what will be there stays from its first use on."""
    for flags in (MCL_CURRENT, MCL_FUTURE | MCL_ONFAULT):
        if _libc().mlockall(flags) != 0:
            number = ctypes.get_errno()
            raise OSError(number, f"mlockall: {os.strerror(number)}")
