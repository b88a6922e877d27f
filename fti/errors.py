"""Exceptions.  A message is one sentence that names the file, the key or device, the value and the allowed values.

    FtiError
        ConfigError        a configuration, scenario or option is wrong           exit 2
        MissingError       a file, port, session or service is not available     exit 2
        LinkError          a port cannot be opened now; the link retries
            PortAbsent     no such device
            PortDenied     no permission
            PortBusy       another program uses it
            PartialSendError  sending was aborted after some bytes were, or may have been, sent
        StorageError       the medium refuses data; the buffers hold the newest frames
        RecordingError     a recorded file is damaged or incomplete               exit 3

Bad bytes from a device never raise: a decoder counts and skips them.  A caller's mistake raises ``ValueError``.
"""

import difflib
from collections.abc import Iterable


def similar_name(name: str, known: Iterable[str]) -> list[str]:
    """The most similar known name; none if none is similar."""
    return difflib.get_close_matches(name, [*known], n=1)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The end of an error about an unknown name: the most similar known one; "" if none is similar."""
    similar = similar_name(name, known)
    return f"; did you mean {similar[0]!r}?" if similar else ""


class FtiError(Exception):
    """Base class of errors that are reported to the user in one sentence."""


class ConfigError(FtiError):
    """A configuration is wrong; the message has file, key path, value and allowed values."""


class MissingError(FtiError):
    """A file, port, session or service does not exist, or cannot be used as the user named it."""


class LinkError(FtiError):
    """A port cannot be used now; the link retries.  ``state`` is the resulting link state."""

    state = "absent"


class PortAbsent(LinkError):
    """The device does not exist, or was removed."""


class PortDenied(LinkError):
    """The device exists, and this user has no permission to open it."""

    state = "denied"


class PortBusy(LinkError):
    """Another program has opened the device exclusively."""

    state = "busy"


class PartialSendError(LinkError):
    """Sending was aborted after some bytes were sent, or may still be sent."""


class StorageError(FtiError):
    """The recording medium refuses data."""


class RecordingError(FtiError):
    """A recorded file is damaged or incomplete."""
