"""What recorder and navigation are told at their start, once, by the supervisor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fti.config import Config, StrictModel
from fti.logger.storage_target import StorageTarget


class LinkStartup(StrictModel):
    """What the recorder sends on a link by itself (hexadecimal; it never understands it)."""

    on_connect: tuple[str, ...] = ()
    polls: tuple[tuple[float, str], ...] = ()


class StorageStartup(StrictModel):
    """Where files go.

    folder   : of the session
    fallback : where it goes on while that refuses
    mounts   : the mount points below which both lay at the start of the session; none : where they lie now
    """

    folder: str
    fallback: str | None = None
    mounts: tuple[str, ...] = ()

    def places(self) -> list[StorageTarget]:
        """The places, the main one first."""
        folders = [folder for folder in (self.folder, self.fallback) if folder]
        if not self.mounts:
            return [StorageTarget.of(folder) for folder in folders]
        return [StorageTarget(Path(folder), Path(mount)) for folder, mount in zip(folders, self.mounts, strict=True)]


class RecorderStartup(StorageStartup):
    """All that the recorder is told, once, by the supervisor.

    first_number : of its files; those of an earlier recorder may be out of sight
    given_up     : smaller numbers that an earlier recorder has taken, of which no file is known that it wrote to
    sending      : for the links that may transmit
    """

    config: Config
    epoch_ns: int
    first_number: int = 0
    skipped_numbers: tuple[int, ...] = ()
    sending: dict[str, LinkStartup]
    attachments: dict[str, str]  # file name: text, recorded in every split
    metadata: dict[str, str]


class NavigationStartup(StorageStartup):
    """All that the navigation process is told, once, by the supervisor.

    without_terrain : why it is not to load the configured one; None : it is
    refusals : of sources, when the process before it ended (rows of ``fti.nav.carried_refusal``)
    """

    config: Config
    epoch_ns: int
    texts: dict[str, str]
    bus: str  # its socket
    without_terrain: str | None = None
    refusals: tuple[dict[str, Any], ...] = ()
    attachments: dict[str, str]
    metadata: dict[str, str]
