"""Shared by the benchmarks: description of the machine, processor time of a process, printed results."""

from __future__ import annotations

import datetime
import os
import platform
import sys
from pathlib import Path

TICK_S = 1 / os.sysconf("SC_CLK_TCK")


def machine() -> str:
    """Processor, cores, Python, system and date, in one line."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    cores = len(os.sched_getaffinity(0))
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    return f"{model or platform.machine()}, {cores} cores, Python {sys.version.split()[0]}, {platform.release()}, {now}"


def cpu_s(pid: int) -> float:
    """User and system time of a process with all its threads [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * TICK_S


def percentile(ordered: list[int], share: float) -> float:
    """The value below which that share of the sorted values lies; 0 when there are none."""
    return float(ordered[min(int(share * len(ordered)), len(ordered) - 1)]) if ordered else 0.0


class Targets:
    """Results compared with targets; ``code`` is 1 when one is missed."""

    def __init__(self) -> None:
        self.code = 0

    def check(self, what: str, holds: bool) -> None:
        """Print whether a target is met."""
        print(f"  {'holds ' if holds else 'MISSED'}  {what}", flush=True)
        if not holds:
            self.code = 1
