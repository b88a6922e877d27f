"""Validates the configuration with all files it names, before anything is created; makes the startup messages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fti import devices
from fti.clock import FakeClock
from fti.config import Config, Link, error_lines
from fti.errors import ConfigError
from fti.links import open_link
from fti.logger.session import CONFIG_ATTACHMENT
from fti.logger.storage_target import StorageTarget
from fti.messages.refusals import CarriedRefusal
from fti.service import realtime
from fti.service.startup import LinkStartup, NavigationStartup, RecorderStartup
from fti.service.supervisor.software_metadata import software_metadata


class ValidatedConfig:
    """The configuration, validated with all files it names.  Raises ConfigError or MissingError.

    devices : with their drivers and checked options
    """

    def __init__(self, config: Config, epoch_ns: int) -> None:
        self._config = config
        self._epoch_ns = epoch_ns
        realtime.check(config)
        with error_lines(config.path, config.text):
            self._texts = devices.read_texts(config)
            self.devices = devices.bind_devices(config, self._texts)
            devices.check_inertial(config, self.devices)
            devices.check_beams(config, self.devices)
            devices.check_scan_drift(config, self.devices)
            devices.check_alert_limits(config)
            devices.check_reference(config, self._texts)
            for i, link in enumerate(config.link):
                _check_link(config, i, link)

    def recorder_startup(
        self, targets: Sequence[StorageTarget], first_number: int = 0, skipped_numbers: Sequence[int] = ()
    ) -> bytes:
        """Startup message of the recorder.  targets : the main one first; the others: see ``RecorderStartup``"""
        startup = RecorderStartup(
            config=self._config,
            **_storage(targets),
            first_number=first_number,
            skipped_numbers=tuple(skipped_numbers),
            epoch_ns=self._epoch_ns,
            sending={link.name: self._link_startup(link.name) for link in self._config.link if link.transmit},
            attachments=self._attachments(),
            metadata=self._metadata(),
        )
        return startup.model_dump_json().encode()

    def navigation_startup(
        self,
        targets: Sequence[StorageTarget],
        bus: Path,
        without_terrain: str | None = None,
        refusals: tuple[CarriedRefusal, ...] = (),
    ) -> bytes:
        """Startup message of navigation.

        bus : its socket;  without_terrain : reason for not loading the terrain;  refusals : initial refusals
        """
        startup = NavigationStartup(
            config=self._config,
            **_storage(targets),
            epoch_ns=self._epoch_ns,
            texts=self._texts,
            bus=str(bus),
            without_terrain=without_terrain,
            refusals=refusals,
            attachments=self._attachments(),
            metadata=self._metadata(),
        )
        return startup.model_dump_json().encode()

    def _link_startup(self, link: str) -> LinkStartup:
        sending = devices.link_transmissions(link, self.devices)
        return LinkStartup(
            on_connect=tuple(data.hex() for data in sending.on_connect),
            polls=tuple((period, data.hex()) for period, data in sending.polls),
        )

    def _attachments(self) -> dict[str, str]:
        """The configuration and all files it names, so that a session is self-contained."""
        return {CONFIG_ATTACHMENT: self._config.text, **self._texts}

    def _metadata(self) -> dict[str, str]:
        session = self._config.session
        return {
            "name": session.name,
            "origin": session.origin,
            "mode": session.mode,
            "epoch_ns": str(self._epoch_ns),
            **software_metadata(self._config),
        }


def _storage(targets: Sequence[StorageTarget]) -> dict[str, Any]:
    folders = [str(target.folder) for target in targets]
    fallback = folders[1] if len(folders) > 1 else None
    return {"folder": folders[0], "fallback": fallback, "mounts": tuple(str(target.mount) for target in targets)}


def _check_link(config: Config, index: int, link: Link) -> None:
    """Report a link that cannot work as an error of the configuration."""
    try:
        open_link(link, FakeClock(), lambda frames, times_ns: None)
    except ConfigError as error:
        raise ConfigError(f"{config.path}: link[{index}]: {error}") from None
