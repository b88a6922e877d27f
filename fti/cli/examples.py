"""List the example files of the package, or copy them to a folder of your own.

Configurations, scenarios, and the files that they name; udev rules and a systemd unit.  A configuration or scenario is
copied with all files that it names; "all" copies everything.  No file is overwritten.

  fti examples
  fti examples copy research_aircraft my_aircraft
  fti examples copy all configs
  fti run configs/demo.toml --links /tmp/links

Scenarios of this list can also be flown by their names: fti hil nominal.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from fti import example_files
from fti.cli._printing import print_line, print_lines


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti examples``."""
    commands = parser.add_subparsers(dest="action", metavar="copy")
    copy = commands.add_parser("copy", help="copy files to a folder", description="Copy example files to a folder.")
    copy.add_argument("name", metavar="NAME", help="a name of the list, a folder of it, or all")
    copy.add_argument("folder", metavar="DIR", type=Path, help="folder to copy to; made if needed")


def run(args: argparse.Namespace) -> int:
    """Print the list, or copy."""
    if args.action == "copy":
        print_lines(str(file) for file in example_files.copy(args.name, args.folder))
        return 0
    for name in example_files.names():
        print_line(f"{name:50} {example_files.title(name)}".rstrip())
    return 0
