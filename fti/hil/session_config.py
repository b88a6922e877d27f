"""The configuration in the attachments of a session."""

from __future__ import annotations

from pathlib import Path

from fti import config as configuration
from fti.config import Config
from fti.errors import MissingError
from fti.logger.reading.recording import Recording
from fti.logger.session import CONFIG_ATTACHMENT


def recorded_config(recording: Recording, session: Path) -> Config:
    """The configuration that a session was recorded with, from its attachment.  Raises MissingError, ConfigError."""
    data = recording.attachments().get(CONFIG_ATTACHMENT)
    if data is None:
        raise MissingError(f"{session}: has no attachment {CONFIG_ATTACHMENT}; give the configuration with --config")
    file = session / CONFIG_ATTACHMENT
    text = configuration.decode_text(data, str(file))
    return configuration.parse(configuration.parse_toml(text, str(file)), text, file)
