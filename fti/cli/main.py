"""The ``fti`` command.

Each other module of this package whose name does not begin with ``_`` is one command (``_`` in a name becomes ``-``).
It has a docstring (its first line is the help, the rest the description), ``add_arguments(parser)`` and
``run(args) -> exit code``.

Exit codes: 0 done; 1 a result does not hold; 2 usage or configuration error, or file/device not found (one sentence on
standard error); 3 readable with losses; 130 interrupted, files closed.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import io
import os
import pkgutil
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import fti.cli
from fti.cli._printing import print_line
from fti.errors import FtiError, RecordingError
from fti.interrupts import track_interrupts

EXIT_WRONG = 2
EXIT_LOSSES = 3
EXIT_INTERRUPTED = 130
#: Environment variable: if set, an unexpected error prints its traceback.
TRACEBACK = "FTI_TRACEBACK"
#: Arguments of commands that name input files.
FILES = ("session", "other", "file", "files", "config", "scenario", "reference", "airfield")


def _commands() -> list[ModuleType]:
    names = (m.name for m in pkgutil.iter_modules(fti.cli.__path__))
    return [importlib.import_module(f"fti.cli.{n}") for n in sorted(names) if n != "main" and not n.startswith("_")]


def make_parser() -> argparse.ArgumentParser:
    """The parser with every command."""
    parser = argparse.ArgumentParser(
        prog="fti", description="Flight-test data service: records every byte, navigates live, emulates the sensors."
    )
    sub = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for module in _commands():
        text = inspect.getdoc(module) or ""
        name = module.__name__.rsplit(".", 1)[1].strip("_").replace("_", "-")
        command = sub.add_parser(
            name,
            help=text.partition("\n")[0].rstrip("."),
            description=text,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(command)
        command.set_defaults(run=module.run, parser=command)
    return parser


def _pydantic_errors() -> tuple[type[Exception], ...]:
    """Errors of pydantic when it cannot build a model; empty where it is not imported, because its import is slow."""
    core = sys.modules.get("pydantic_core")
    return (core.SchemaError,) if core else ()


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; an error is one sentence on standard error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # escape text that the terminal's encoding lacks
            stream.reconfigure(errors="backslashreplace")
    args = argparse.Namespace(command="")
    try:
        return _run(argv, args)
    except _pydantic_errors():
        raise
    except Exception as error:  # a file with unforeseen content
        if os.environ.get(TRACEBACK):
            raise
        print_line(f"fti: {_unexpected_error(args, error)}", error=True)
        return EXIT_LOSSES


def _run(argv: Sequence[str] | None, args: argparse.Namespace) -> int:
    """Run the command and map its expected errors to exit codes.  args : filled"""
    try:
        with track_interrupts() as handler:
            _, unknown = make_parser().parse_known_args(argv, args)
        if handler.interrupted:
            raise KeyboardInterrupt
        if unknown:  # prints the usage of the command
            args.parser.error(f"unrecognized arguments: {' '.join(unknown)}")
        return int(args.run(args))
    except RecordingError as error:
        print_line(f"fti: {error}", error=True)
        return EXIT_LOSSES
    except FtiError as error:
        print_line(f"fti: {error}", error=True)
        return EXIT_WRONG
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except _pydantic_errors() as error:  # an interrupt while a model is built
        if KeyboardInterrupt.__name__ not in str(error):
            raise
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader of the output has closed the pipe, as ``| head`` does
        sys.stderr.close()
        return 0


def _unexpected_error(args: argparse.Namespace, error: Exception) -> str:
    """One sentence for an error that no command handles."""
    named = (getattr(args, name, None) for name in FILES)
    files = [str(one) for value in named if value for one in (value if isinstance(value, list) else [value])]
    *_, frame = traceback.extract_tb(error.__traceback__)
    message = " ".join(str(error).split())[:200]
    cause = f"{type(error).__name__} {message}".strip()
    where = f"{Path(frame.filename).name}:{frame.lineno}"
    return f"{' '.join((args.command, *files))}: failed with {cause} ({where}); {TRACEBACK}=1 prints the traceback"


if __name__ == "__main__":
    sys.exit(main())
