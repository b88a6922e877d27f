"""Complete commands in the shell, and write manual pages.

Prints the completion script of a shell; a new shell then completes commands, options, files, scenarios, drivers, topics
and studies.  It asks fti at each key, so it never gets out of date.

  echo 'eval "$(fti completion bash)"' >> ~/.bashrc
  echo 'eval "$(fti completion zsh)"' >> ~/.zshrc                     after compinit
  fti completion fish > ~/.config/fish/completions/fti.fish
  fti completion man ~/.local/share/man                               then: man fti, man fti-run
"""

from __future__ import annotations

import argparse
from pathlib import Path

from fti.cli._printing import print_line, print_lines

SHELLS = ("bash", "zsh", "fish")
MANUAL = "man"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to write, and DIR."""
    parser.add_argument("what", choices=(*SHELLS, MANUAL), help="the shell, or man: manual pages")
    parser.add_argument("dir", nargs="?", type=Path, metavar="DIR", help="with man: write the pages into DIR/man1")


def run(args: argparse.Namespace) -> int:
    """Print the script, or write the pages."""
    if (args.what == MANUAL) != (args.dir is not None):
        args.parser.error("DIR: missing; man needs it" if args.what == MANUAL else "DIR: only with man")
    if args.what == MANUAL:
        _write_pages(args.dir / "man1")
        return 0
    from argcomplete.shell_integration import shellcode

    print_lines(shellcode(["fti"], shell=args.what).strip().splitlines())
    return 0


def _write_pages(folder: Path) -> None:
    """Write the manual page of each command.  Raises StorageError."""
    from fti.cli._man_page import pages
    from fti.cli._parser import make_parser
    from fti.errors import StorageError

    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in pages(make_parser()).items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise StorageError(f"{folder}: cannot be written: {error.strerror}") from None
    print_line(folder)
