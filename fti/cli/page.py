"""Open the page of a running daemon in the browser, with the key to set marks and send commands.

Without the key the page is read-only.  The daemon makes a new key at each start; only the user who started it can read
the key.

  fti page                   open the browser
  fti page --print           print the address with the key, for a browser that cannot open files of the run directory

From another computer: ssh -L 8080:127.0.0.1:8080 USER@RECORDER, then open there the address that fti page --print
prints here.  Both ports must be the port of the printed address.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti page``."""
    parser.add_argument("--print", action="store_true", help="print the address with the key and exit")
    parser.add_argument("--run-dir", metavar="DIR", help="run directory of the daemon, if several are running")


def run(args: argparse.Namespace) -> int:
    """Open the page, or print its address."""
    from pathlib import Path

    from fti.cli._printing import print_line
    from fti.errors import MissingError
    from fti.run_directory import find_daemon

    info = find_daemon(args.run_dir)
    if info.page is None:
        raise MissingError(f"the daemon {info.name} serves no page: display.enabled is false, or see its events")
    if args.print:
        print_line(info.page)
    elif not open_browser(Path(info.sock).parent):
        raise MissingError("cannot open a browser; fti page --print prints the address")
    return 0


def open_browser(run_dir: Path) -> bool:
    """Open the page of the daemon that has this run directory; False when there is no browser.

    The browser gets the name of a private file that redirects it: every user can read its command line, not the file.
    """
    import webbrowser

    from fti.run_directory import PAGE

    return webbrowser.open((run_dir / PAGE).absolute().as_uri())
