"""Startup messages of the supervisor to recorder and navigation, sent once at their start."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

from pydantic import PlainSerializer, PlainValidator

from fti.config import Config, StrictModel
from fti.logger.storage_target import StorageTarget
from fti.messages.refusals import CarriedRefusal
from fti.messages.tables import from_table, to_table

CarriedRefusals = Annotated[
    tuple[CarriedRefusal, ...],
    PlainValidator(partial(from_table, tuple[CarriedRefusal, ...])),
    PlainSerializer(to_table),
]


class LinkStartup(StrictModel):
    """Data that the recorder sends on a link by itself (hexadecimal; it does not interpret them)."""

    on_connect: tuple[str, ...] = ()
    polls: tuple[tuple[float, str], ...] = ()


class StorageStartup(StrictModel):
    """The storage targets.

    folder   : folder of the session
    fallback : folder used while ``folder`` cannot be written
    mounts   : mount points of both at the start of the session; empty: the present mount points
    """

    folder: str
    fallback: str | None = None
    mounts: tuple[str, ...] = ()

    def targets(self) -> list[StorageTarget]:
        """The storage targets, the main one first."""
        folders = [folder for folder in (self.folder, self.fallback) if folder]
        if not self.mounts:
            return [StorageTarget.of(folder) for folder in folders]
        return [StorageTarget(Path(folder), Path(mount)) for folder, mount in zip(folders, self.mounts, strict=True)]


class RecorderStartup(StorageStartup):
    """Startup message of the recorder.

    first_number    : number of its first file; files of an earlier recorder may be on an unmounted medium
    skipped_numbers : smaller numbers taken by an earlier recorder without a known file
    sending         : for the links that may transmit
    """

    config: Config
    epoch_ns: int
    first_number: int = 0
    skipped_numbers: tuple[int, ...] = ()
    sending: dict[str, LinkStartup]
    attachments: dict[str, str]  # file name: text, recorded in every split
    metadata: dict[str, str]


class NavigationStartup(StorageStartup):
    """Startup message of the navigation process.

    without_terrain : reason for not loading the configured terrain; None : load it
    refusals : refusals of sources when the previous process ended
    """

    config: Config
    epoch_ns: int
    texts: dict[str, str]
    bus: str  # its socket
    without_terrain: str | None = None
    refusals: CarriedRefusals = ()
    attachments: dict[str, str]
    metadata: dict[str, str]
