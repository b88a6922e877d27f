"""The configuration: one TOML file, strict, read once and frozen.

Links say what is plugged in, devices what is understood, roles (``[nav]``) what is used for what.
Relative paths are relative to the file.  An error names the file, the key path, the value and what is allowed.
"""

from fti.config.binding import bind
from fti.config.loading import load, parse, read_toml, with_links, with_session
from fti.config.parsing import decode_text, parse_toml
from fti.config.tables import (
    AlertLimits,
    Altimeter,
    Approach,
    Buffered,
    Bus,
    CanLink,
    Config,
    Device,
    Display,
    Filter,
    Link,
    Name,
    Nav,
    Positive,
    Radio,
    RecorderTuning,
    SerialLink,
    Session,
    Snapshot,
    SourceLimits,
    StrictModel,
    TerrainFiles,
    UdpLink,
    UnstatedSd,
    Vector,
    position_sources,
)

__all__ = [
    "AlertLimits",
    "Altimeter",
    "Approach",
    "Buffered",
    "Bus",
    "CanLink",
    "Config",
    "Device",
    "Display",
    "Filter",
    "Link",
    "Name",
    "Nav",
    "Positive",
    "Radio",
    "RecorderTuning",
    "SerialLink",
    "Session",
    "Snapshot",
    "SourceLimits",
    "StrictModel",
    "TerrainFiles",
    "UdpLink",
    "UnstatedSd",
    "Vector",
    "bind",
    "decode_text",
    "load",
    "parse",
    "parse_toml",
    "position_sources",
    "read_toml",
    "with_links",
    "with_session",
]
