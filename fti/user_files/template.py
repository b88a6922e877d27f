"""Examples of tables, and commented templates of files, as TOML."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping

from fti.config.keys import NO_UNIT, Key, toml_value
from fti.hil.oracle.fault_catalogue import fault_kinds
from fti.user_files import tables
from fti.user_files.tables import Table

WIDTH = 100
MARKING = (
    "\nA line that begins with # and a blank is a comment.  One that begins with # alone is a table, or a key with its "
    "default, or with an example where it has none: remove the # to set it."
)


def example(table: Table) -> str:
    """The table with the keys that have an example, or with all defaults if none has one; "" if it has neither."""
    pairs = [(key.name, key.example.replace("}, {", "},\n  {")) for key in table.keys if key.example]
    pairs = pairs or [(key.name, key.default) for key in table.keys if not key.has_section and key.default]
    if not pairs:
        return ""
    head = [table.head, f'kind = "{table.kind}"' if table.kind else ""]
    return "\n".join([line for line in head if line] + [f"{name} = {value}" for name, value in pairs])


def commented(found: Iterable[Table], set_keys: Mapping[str, str]) -> Iterator[str]:
    """Lines of a file with every key and its meaning as a comment.

    A line that begins with # and no space is a table, or a key with its default, or with an example where it has none.

    set_keys : keys at the top that are set, with their values as TOML
    """
    for table in found:
        if table.head:
            yield from ("", "", *_comment(table.description), f"#{table.head}")
        if table.kind:
            yield f'#kind = "{table.kind}"'
        for key in table.keys:
            if not key.has_section:
                value = "" if table.head else set_keys.get(key.name, "")
                yield from ("", *_comment(_meaning(key)))
                yield f"{key.name} = {value}" if value else f"#{key.name} = {_shown(key)}"


def airfield() -> str:
    """An airfield file with every key; the required ones have the values of an example."""
    found = tables.airfield()
    examples = {key.name: key.example for key in found[0].keys if not key.default}
    head = "Airfield of fti reference make --airfield FILE.  The values are those of an imaginary airfield."
    return "\n".join([*_comment(head + MARKING), *commented(found, examples)]) + "\n"


def scenario(config: str) -> str:
    """A scenario with every key, and a fault as an example.  config : the daemon's configuration"""
    values = {"title": "Template", "description": "A nominal approach.", "config": config}
    set_keys = {name: toml_value(value) for name, value in values.items()}
    kinds = fault_kinds().values()
    lines = [
        *_comment("Scenario of fti hil, fti check and fti score." + MARKING),
        *commented(tables.scenario(), set_keys),
        *("", "", *_comment("Faults.  Kinds, each described with its keys by fti hil --faults KIND:")),
        *(f"#   {kind.kind}: {kind.description.splitlines()[0]}" for kind in kinds),
        *(f"#{line}" for line in fault_kinds()["cut"].example.splitlines()),
    ]
    return "\n".join(lines) + "\n"


def _meaning(key: Key) -> str:
    unit = "" if key.unit == NO_UNIT else f" [{key.unit}]"
    default = {"": "required", "none": "may be absent"}.get(key.default, f"default {key.default}")
    return f"{key.name}{unit}: {key.description} ({key.limits}; {default})"


def _shown(key: Key) -> str:
    """The default, or an example where there is none."""
    return (key.example or key.instead) if key.default in ("", "none") else key.default


def _comment(text: str) -> Iterator[str]:
    for line in text.splitlines():
        yield from (f"# {part}".rstrip() for part in textwrap.wrap(line, WIDTH - 2) or [""])
