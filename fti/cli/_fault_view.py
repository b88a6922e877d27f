"""Output of ``fti hil --faults``, as JSON and as text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from fti.cli._check_view import table_lines

if TYPE_CHECKING:
    from fti.config.keys import Key
    from fti.hil.oracle.fault_catalogue import FaultDescription


def as_json(kinds: Iterable[FaultDescription]) -> list[dict[str, Any]]:
    """Every kind with all of its keys."""
    return [asdict(kind) for kind in kinds]


def overview(kinds: Iterable[FaultDescription]) -> Iterator[str]:
    """Every kind; keys that all kinds of devices or of links share are listed once at the end."""
    from fti.hil.oracle.fault_catalogue import SHARED_KEYS

    shared = dict[str, "Key"]()
    for kind in kinds:
        yield from _head(kind)
        yield from _keys(kind.own_keys)
        yield from _flags(kind)
        yield ""
        shared |= {key.name: key for key in kind.keys if key.name in SHARED_KEYS}
    yield "Keys that all faults of CAN links (links) or of devices (devices) share"
    yield from _keys([shared[name] for name in SHARED_KEYS])
    yield ""
    yield "fti hil --faults KIND shows one of them with an example"


def detail(kind: FaultDescription) -> Iterator[str]:
    """One kind with all of its keys, its flags and an example."""
    from fti.hil.tables.quantity_names import quantities

    yield from _head(kind)
    yield from _keys(kind.keys)
    yield from _flags(kind)
    if any(key.name == "quantity" for key in kind.keys):
        yield "  quantities, measurement.field"
        rows: list[tuple[str, ...]] = [(name, ", ".join(fields)) for name, fields in quantities().items()]
        yield from ("  " + line for line in table_lines(rows))
    yield "  example"
    yield from (f"    {line}" for line in kind.example.splitlines())


def _head(kind: FaultDescription) -> Iterator[str]:
    first, *rest = kind.description.splitlines()
    yield f"{kind.kind}: {first}"
    yield from (f"  {line}" for line in rest if line)
    drivers = f" whose driver is one of {', '.join(kind.drivers)}" if kind.drivers else ""
    yield f"  applies to: {kind.subject}{drivers}"


def _keys(keys: Iterable[Key]) -> Iterator[str]:
    rows: list[tuple[str, ...]] = [
        (key.name, f"[{key.unit}]", _default(key), key.description, key.limits) for key in keys
    ]
    if rows:
        yield "  keys"
        yield from ("  " + line for line in table_lines(rows))


def _default(key: Key) -> str:
    return f"default {key.default}" if key.default else "required"


def _flags(kind: FaultDescription) -> Iterator[str]:
    if kind.flags:
        yield "  flags"
        yield from ("  " + line for line in table_lines([flag_cells(flag) for flag in kind.flags]))
    if kind.no_flag:
        yield f"  no flag {'if' if kind.flags else 'at all:'} {kind.no_flag}"


def flag_cells(flag: Any) -> tuple[str, ...]:
    """Words, place and condition of a flag."""
    return (" or ".join(flag.words) or "the stated number", flag.place, f"if {flag.when}" if flag.when else "")
