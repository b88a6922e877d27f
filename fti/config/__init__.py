"""The configuration: one TOML file, strict, read once and frozen.

Links define the ports, devices the drivers on them, roles (``[nav]``) the use of each device.
Relative paths are relative to the file.  An error names the file, the key path, the value and the allowed values.
"""

from fti.config.binding import bind
from fti.config.error_lines import check_all, error_lines
from fti.config.loading import load, parse, read_toml, with_links, with_session
from fti.config.parsing import decode_text, parse_toml
from fti.config.tables import (
    AlertLimits,
    Altimeter,
    Approach,
    Bus,
    CanLink,
    Config,
    Device,
    Display,
    Filter,
    Link,
    LinkTable,
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
    altimeter_links,
    position_sources,
)

__all__ = [
    "AlertLimits",
    "Altimeter",
    "Approach",
    "Bus",
    "CanLink",
    "Config",
    "Device",
    "Display",
    "Filter",
    "Link",
    "LinkTable",
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
    "altimeter_links",
    "bind",
    "check_all",
    "decode_text",
    "error_lines",
    "load",
    "parse",
    "parse_toml",
    "position_sources",
    "read_toml",
    "with_links",
    "with_session",
]
