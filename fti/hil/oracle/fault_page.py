"""Generator of docs/faults.md: the content of ``fti hil --faults`` as a page.

python -m fti.hil.oracle.fault_page docs/faults.md    (or: make docs)
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from fti.config.keys import Key
from fti.hil.oracle.fault_catalogue import SHARED_KEYS, FaultDescription, fault_kinds
from fti.hil.oracle.flags_of_kinds import KindFlag
from fti.hil.tables.quantity_names import quantities

HEAD = """# Faults of the laboratory

<!-- Generated from the tables that scenarios are read with: do not edit, run `make docs`. -->

One `[[fault]]` table of a scenario for each fault. `fti hil --faults` prints this page in the terminal,
`fti hil --faults KIND` one kind, `--json` the same for programs. `fti check SCENARIO` prints the flags that the faults
of a scenario must raise with its configuration, and their limits in seconds.

- **Unit**: `of the quantity` is SI or radians; `1` is a ratio, a probability or a count; `-` has no unit.
- **Default**: an empty cell is a required key; `none` is an optional key that may be absent.
- **Flags**: one of the words must be raised at the place. Capitals stand for names: `DEVICE` has the fault, `LINK` has
  it or carries the device, `ALTIMETER` is one of `nav.altimeters`, `UNIT` is a power unit, `FLAG` is one of the flags
  of the fault. A fault that ends before a flag must be raised need not raise it.
- The examples are valid with `configs/demo.toml`.

## Keys that faults share

Faults of CAN links have `links`, `from_s` and `to_s`; faults of devices have `devices`, `from_s` and `to_s`. Faults of
the world (`obstacle`, `off_track`, `terrain_shift`) have their own.
"""


def page() -> str:
    """The text of the page."""
    return "\n".join(_lines(list(fault_kinds().values()))) + "\n"


def _lines(descriptions: Sequence[FaultDescription]) -> Iterator[str]:
    shared = {key.name: key for kind in descriptions for key in kind.keys if key.name in SHARED_KEYS}
    yield HEAD
    yield from _keys([shared[name] for name in SHARED_KEYS])
    for kind in descriptions:
        yield from ("", *_section(kind))
    yield from ("", "## Quantities", "", "`quantity` is the name of a measurement, a dot, and one of its fields.", "")
    yield from _table(
        ("measurement", "fields"), [(f"`{name}`", _code(fields)) for name, fields in quantities().items()]
    )


def _section(kind: FaultDescription) -> Iterator[str]:
    drivers = f" whose driver is one of {_code(kind.drivers)}" if kind.drivers else ""
    yield from (f"## `{kind.kind}`", "", kind.description, "", f"Of: {kind.subject}{drivers}.")
    if kind.own_keys:
        yield from ("", *_keys(kind.own_keys))
    if kind.flags:
        yield from ("", *_table(("flag", "at", "if"), [_flag(flag) for flag in kind.flags]))
    if kind.no_flag:
        yield from ("", f"No flag {'if' if kind.flags else 'at all:'} {kind.no_flag}.")
    yield from ("", "```toml", kind.example, "```")


def _keys(keys: Iterable[Key]) -> Iterator[str]:
    rows = [(f"`{k.name}`", k.unit, f"`{k.default}`" if k.default else "", k.limits, k.description) for k in keys]
    return _table(("key", "unit", "default", "limits", "meaning"), rows)


def _flag(flag: KindFlag) -> tuple[str, ...]:
    words = " or ".join(f"`{word}`" for word in flag.words) or "the stated number"
    return (words, f"`{flag.place}`", flag.when)


def _code(words: Iterable[str]) -> str:
    return ", ".join(f"`{word}`" for word in words)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield from (f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
