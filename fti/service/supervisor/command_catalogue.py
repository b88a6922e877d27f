"""The commands of all devices: from their drivers, for links that may transmit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fti.config import Config
from fti.devices import BoundDevice
from fti.messages.control import CommandDescription, DeviceCommands


class CommandDenied(ValueError):
    """A command is not sent; the text has the reason and the allowed values or the key to set."""


@dataclass(frozen=True, slots=True)
class EncodedCommand:
    """The bytes of a command and their link.  answered : the device acknowledges it."""

    link: str
    data: bytes
    answered: bool


class CommandCatalogue:
    """The devices of a session and their commands."""

    def __init__(self, config: Config, devices: Sequence[BoundDevice]) -> None:
        self._path = config.path
        self._devices = {bound.device.name: bound for bound in devices}
        self._transmit = {link.name: link.transmit for link in config.link}

    def describe(self) -> list[DeviceCommands]:
        """Every device with its commands."""
        return [
            DeviceCommands(
                name=name,
                driver=bound.device.driver,
                link=bound.device.link,
                transmit=self._transmit[bound.device.link],
                commands={
                    key: CommandDescription(c.does, dict(c.arguments), c.answered)
                    for key, c in bound.driver.COMMANDS.items()
                },
            )
            for name, bound in self._devices.items()
        ]

    def usable(self) -> list[DeviceCommands]:
        """The devices with commands, on links that may transmit."""
        return [device for device in self.describe() if device.transmit and device.commands]

    def is_polled(self, device: str) -> bool:
        """The recorder polls the device, so it answers without a command."""
        bound = self._devices.get(device)
        if bound is None or not self._transmit[bound.device.link]:
            return False
        return bound.driver.poll(bound.options) is not None

    def encode(self, device: str, command: str, args: Mapping[str, str]) -> EncodedCommand:
        """The bytes of a command.  Raises CommandDenied."""
        bound = self._devices.get(device)
        if bound is None:
            raise CommandDenied(f"unknown device {device!r}; configured: {', '.join(self._devices) or 'none'}")
        known = bound.driver.COMMANDS
        if command not in known:
            allowed = f"commands: {', '.join(known)}" if known else "its driver has no commands"
            raise CommandDenied(f"{device} ({bound.device.driver}): unknown command {command!r}; {allowed}")
        self._permit(bound)
        try:
            data = bound.driver.command(command, args, bound.options)
        except ValueError as error:
            raise CommandDenied(f"{device}: {error}") from None
        return EncodedCommand(bound.device.link, data, known[command].answered)

    def _permit(self, bound: BoundDevice) -> None:
        name, link = bound.device.name, bound.device.link
        if not self._transmit[link]:
            where = f'[[link]] name = "{link}"'
            raise CommandDenied(f"{name}: its link does not transmit; set transmit = true at {where} of {self._path}")
