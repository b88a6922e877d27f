"""Access to the page: commands need the key of this start, which only the owner of the daemon can read.

Any user of the machine can open a port on loopback, so the page is visible to all users and accepts marks and commands
only with the key.  The supervisor creates a key for each start of the display and sends it over the control channel
(command line and environment are readable by others), and publishes it to the owner in the run directory: in
``fti.json`` and in ``page.html``, which redirects a browser to the address with the key.  The key follows a ``#``: a
browser does not send that part.
"""

from __future__ import annotations

import secrets

KEY_BYTES = 32


class PageAccess:
    """The addresses of the page.

    address  : of loopback; shows_key : the announcement has the key; only for a terminal
    """

    def __init__(self, address: str, *, shows_key: bool) -> None:
        self._address, self._shows_key = address, shows_key
        self._port: int | None = None
        self.key = secrets.token_urlsafe(KEY_BYTES)

    def forget(self) -> None:
        """The display has ended: replace the key, since open pages may send it to another program on that port."""
        self._port = None
        self.key = secrets.token_urlsafe(KEY_BYTES)

    def on_port(self, port: int) -> None:
        """The display serves the page at a port."""
        self._port = port

    @property
    def url(self) -> str | None:
        """Address of the read-only page; None until it is served."""
        return None if self._port is None else f"http://{self._address}:{self._port}/"

    @property
    def owner_url(self) -> str | None:
        """Address with the key."""
        return self.url and f"{self.url}#key={self.key}"

    @property
    def announcement(self) -> str:
        """The line for the user."""
        return f"display at {self.owner_url if self._shows_key else self.url}"
