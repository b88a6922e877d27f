"""Limits of the user's processes (``ulimit``), before the session begins: open files and file size.

The soft limit of open files is raised to the hard limit, limits that are too low are an error, and files are split
before they reach the limit of their size.
"""

from __future__ import annotations

import resource
from collections.abc import Callable

from fti.buffers.ring import ring_size
from fti.config import Config, with_session
from fti.errors import MissingError

MIB = 2**20
#: Open files of the largest process without those of the links: files, sockets of the bus and of the page.
BASE_FILES = 64
FILES_PER_LINK = 4
#: Distance between the split size and the limit of the file size [B].
SPLIT_MARGIN = 16 * MIB


def raise_open_files() -> None:
    """Raise the soft limit of open files to the hard limit, for this process and its children."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def adapt_to_limits(config: Config, announce: Callable[[str], None]) -> Config:
    """The configuration with ``split_mb`` below the limit.  Raises MissingError for a limit that is too low."""
    _check_open_files(len(config.link))
    size, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    if size == resource.RLIM_INFINITY:
        return config
    needed = ring_size(config.link) + MIB  # the ring is a file in memory
    if size < needed:
        raise MissingError(
            f"the limit of file size (ulimit -f) is {size} bytes; must be at least {needed} for "
            f"{len(config.link)} links"
        )
    split_mb = max(size / 2, size - SPLIT_MARGIN) / MIB
    if config.session.split_mb <= split_mb:
        return config
    announce(
        f"warning: storage: the limit of file size (ulimit -f) is {size / MIB:.0f} MiB: a new file begins after "
        f"{split_mb:.0f} MiB instead of session.split_mb = {config.session.split_mb:g}"
    )
    return with_session(config, split_mb=split_mb)


def _check_open_files(links: int) -> None:
    needed = BASE_FILES + FILES_PER_LINK * links
    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed < needed:
        raise MissingError(
            f"the limit of open files (ulimit -n, LimitNOFILE= of systemd) is {allowed}; must be at least {needed} for "
            f"{links} links"
        )
