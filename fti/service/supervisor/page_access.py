"""Who may command from the page: whoever has the key of this start, which only the owner of the daemon can read.

Any user of the machine can open a port of loopback, so the page shows itself to everybody and takes marks and commands
only with the key.  The supervisor makes one for each start of the display and hands it over the control channel
(command line and environment are no place for it), and to the owner in the run directory: in ``fti.json`` and in
``page.html``, which leads a browser to the address with the key.  The key stands behind a ``#``, which a browser does
not send.
"""

from __future__ import annotations

import secrets

KEY_BYTES = 32


class PageAccess:
    """The addresses of the page.

    address  : of loopback; shows_key : the line for the user has the key, since it goes to his terminal alone
    """

    def __init__(self, address: str, *, shows_key: bool) -> None:
        self._address, self._shows_key = address, shows_key
        self._port: int | None = None
        self.key = secrets.token_urlsafe(KEY_BYTES)

    def forget(self) -> None:
        """The display has gone: another program may have its port, and pages that are open send it the key."""
        self._port = None
        self.key = secrets.token_urlsafe(KEY_BYTES)

    def on_port(self, port: int) -> None:
        """The display serves the page at a port."""
        self._port = port

    @property
    def url(self) -> str | None:
        """The page for everybody, which only shows; None until it is served."""
        return None if self._port is None else f"http://{self._address}:{self._port}/"

    @property
    def owner_url(self) -> str | None:
        """The page with the key."""
        return self.url and f"{self.url}#key={self.key}"

    @property
    def announcement(self) -> str:
        """The line for the user."""
        return f"display at {self.owner_url if self._shows_key else self.url}"
