"""Exceptions.  A message is one sentence that names the file, the key or device, the value and what is allowed.

    FtiError
        ConfigError        a configuration, scenario or option is wrong           exit 2
        MissingError       a file, port, session or service is not there          exit 2
        LinkError          a port cannot be opened now; the link retries
            PortAbsent     no such device
            PortDenied     no permission
            PortBusy       another program holds it
            SentInPart     sending was given up, and something has gone out, or yet may
        StorageError       the medium refuses; the buffers hold what they can
        RecordingError     a recorded file is damaged or incomplete               exit 3

Bad bytes from a device are never an exception: a decoder counts and skips them.  A caller's mistake is a
``ValueError``.
"""


class FtiError(Exception):
    """Root of what the program says to its user in one sentence."""


class ConfigError(FtiError):
    """A configuration is wrong; the message names file, key path, value and what is allowed."""


class MissingError(FtiError):
    """Something that the user named does not exist."""


class LinkError(FtiError):
    """A port cannot be used now; the link keeps trying.  ``state`` is the link state that the user sees."""

    state = "absent"


class PortAbsent(LinkError):
    """There is no such device, or it went away."""


class PortDenied(LinkError):
    """The device is there and this user may not open it."""

    state = "denied"


class PortBusy(LinkError):
    """Another program holds the device exclusively."""

    state = "busy"


class PartialSendError(LinkError):
    """Sending was given up, and something of it has gone out all the same, or yet may."""


class StorageError(FtiError):
    """The recording medium refuses to take bytes."""


class RecordingError(FtiError):
    """A recorded file is damaged or incomplete."""
