"""The ``fti`` command.

Each other module of this package whose name does not begin with ``_`` is one command (``_`` in a name becomes ``-``),
and is in a group of ``_parser.GROUPS``.  It has a docstring (its first line is the help, the rest the description),
``add_arguments(parser)`` and ``run(args) -> exit code``.

Exit codes: 0 done; 1 a result does not hold; 2 usage or configuration error, or file/device not found (one sentence on
standard error); 3 readable with losses; 130 interrupted, files closed.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

from fti.cli._completion import COMPLETE, complete
from fti.cli._parser import make_parser
from fti.cli._printing import print_line, print_lines
from fti.errors import FtiError, RecordingError
from fti.interrupts import track_interrupts
from fti.quick_exit import skip_last_collection

EXIT_WRONG = 2
EXIT_LOSSES = 3
EXIT_INTERRUPTED = 130
#: Environment variable: if set, an unexpected error prints its traceback.
TRACEBACK = "FTI_TRACEBACK"
#: Arguments of commands that name input files.
FILES = ("session", "other", "file", "files", "config", "scenario", "reference", "airfield")


def _pydantic_errors() -> tuple[type[Exception], ...]:
    """Errors of pydantic when it cannot build a model; empty where it is not imported, because its import is slow."""
    core = sys.modules.get("pydantic_core")
    return (core.SchemaError,) if core else ()


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; an error is one sentence on standard error."""
    if argv is None:  # it is the whole process
        skip_last_collection()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # escape text that the terminal's encoding lacks
            stream.reconfigure(errors="backslashreplace")
    if COMPLETE in os.environ:
        complete(make_parser())
    if not (sys.argv[1:] if argv is None else argv):
        make_parser().print_help(sys.stderr)
        return EXIT_WRONG
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
        print_lines((f"fti: {line}" for line in str(error).splitlines()), error=True)  # one for each mistake
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
