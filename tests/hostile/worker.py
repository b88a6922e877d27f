"""A process that runs commands over hostile files: ``python -m tests.hostile.worker FOLDER < pairs``.

Each line of input is a pair as JSON, [damage, command, seed]; each line of output what became of it, and last the peak
of this process' memory [kB].  An error that reaches the last net of ``fti`` comes out as a traceback here.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import resource
import shutil
import struct
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from tests.hostile.commands import FILE_COMMANDS, SESSION_COMMANDS, filled
from tests.hostile.damage import DAMAGES
from tests.hostile.files import AIRFIELD, write_file
from tests.hostile.recipes import write

ADDRESS_SPACE = 16 * 2**30


def main() -> None:
    """Until the input ends."""
    os.environ["FTI_TRACEBACK"] = "1"
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    _replay_without_readers()
    folder = Path(sys.argv[1])
    for number, line in enumerate(sys.stdin):
        damage, command, seed = json.loads(line)
        place = folder / str(number)
        place.mkdir()
        print(json.dumps(_run(damage, command, seed, place)), flush=True)
        shutil.rmtree(place)
    print(peak_kb())


def peak_kb() -> int:
    """The most memory that this process ever had [kB]; ``ru_maxrss`` also counts that of the one which started it."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0])


def _replay_without_readers() -> None:
    """Nobody opens the far ends here."""
    from fti.hil import replay

    async def nobody(*_: object) -> None:
        return

    replay.Replay._wait_for_reader = nobody  # type: ignore[assignment]


def _arguments(damage: str, command: Any, seed: int, place: Path) -> list[str]:
    out = place / "out"
    out.mkdir()
    (place / "airfield.toml").write_text(AIRFIELD)
    rng = random.Random(seed)
    places = {"OUT": out, "AIRFIELD": place / "airfield.toml"}
    if damage in DAMAGES:
        session = write(DAMAGES[damage](rng), place)
        _put_next_to(session)
        return filled(SESSION_COMMANDS[command], {"SESSION": session, **places})
    kind, _, name = damage.partition(": ")
    file = write_file(kind, name, rng, place)
    if "SESSION" in FILE_COMMANDS[kind][command]:
        places["SESSION"] = write(DAMAGES["packed"](rng), place)
    return filled(FILE_COMMANDS[kind][command], {"FILE": file, **places})


def _put_next_to(session: Path) -> None:
    """The recorded configuration as a file, and a scenario that flies the session again."""
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    with contextlib.suppress(McapError, ValueError, OSError, struct.error, LookupError, MemoryError, StopIteration):
        raw = next(path for path in sorted(session.glob("s_*.mcap")) if "derived" not in path.name)
        with raw.open("rb") as stream:
            for attachment in make_reader(stream).iter_attachments():
                if attachment.name == "config.toml":
                    (session / "config.toml").write_bytes(attachment.data)
    (session / "recorded.toml").write_text(
        'title = "x"\ndescription = ""\nconfig = "config.toml"\nseed = 1\n[flight]\nkind = "recorded"\nfile = "."\n'
    )


def _run(damage: str, command: Any, seed: int, place: Path) -> dict[str, Any]:
    from fti.cli.main import main as fti

    started = time.monotonic()
    arguments = _arguments(damage, command, seed, place)
    out, printed = io.TextIOWrapper(io.BytesIO(), "utf-8"), io.BytesIO()
    err = io.TextIOWrapper(printed, "utf-8")
    content: dict[str, Any] = {"pair": [damage, command, seed], "arguments": arguments, "traceback": ""}
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), contextlib.chdir(place):
        try:
            content["code"] = fti(arguments)
        except SystemExit as end:
            content["code"] = end.code
        except BaseException:  # noqa: BLE001  that is what is looked for
            content["code"], content["traceback"] = None, traceback.format_exc()
        out.flush()
        err.flush()
    return {**content, "stderr": printed.getvalue().decode(), "s": time.monotonic() - started, "peak_kb": peak_kb()}


if __name__ == "__main__":
    main()
