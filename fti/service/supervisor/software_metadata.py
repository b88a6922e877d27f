"""Metadata of a session about the software, the configuration and the computer."""

from __future__ import annotations

import hashlib
import platform
from importlib.metadata import version
from pathlib import Path

from fti.config import Config


def software_metadata(config: Config) -> dict[str, str]:
    """The metadata of a session with this configuration on this computer."""
    return {
        "software": version("fti"),
        "config_file": Path(config.path).name,
        "config_sha256": hashlib.sha256(config.text.encode()).hexdigest(),
        "python": platform.python_version(),
        "processor": _processor(),
    }


def _processor() -> str:
    """Model of the processor; outputs are bit-identical only on the same model."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor())
