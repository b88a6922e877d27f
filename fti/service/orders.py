"""What recorder and navigation are told at their start, once, by the supervisor."""

from __future__ import annotations

from fti.config import Config, StrictModel


class LinkOrder(StrictModel):
    """What the recorder sends on a link by itself (hexadecimal; it never understands it)."""

    on_connect: tuple[str, ...] = ()
    polls: tuple[tuple[float, str], ...] = ()


class RecorderOrder(StrictModel):
    """All that the recorder is told, once, by the supervisor."""

    config: Config
    folder: str
    epoch_ns: int
    sending: dict[str, LinkOrder]
    attachments: dict[str, str]  # file name: text, recorded in every split
    metadata: dict[str, str]


class NavigationOrder(StrictModel):
    """All that the navigation process is told, once, by the supervisor."""

    config: Config
    folder: str
    epoch_ns: int
    texts: dict[str, str]
    endpoint: str | None
    attachments: dict[str, str]
    metadata: dict[str, str]
