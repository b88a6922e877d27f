"""Generator of docs/reference: every key of the files that a user writes, and the reasons in the outputs.

python -m fti.user_files.page docs/reference    (or: make docs)
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from fti import drivers
from fti.config.keys import Key
from fti.hil.scenario import fault_table
from fti.messages.reasons import Reason
from fti.reason_texts import REASONS
from fti.user_files import tables
from fti.user_files.tables import Table
from fti.user_files.template import example

#: The name of a table in a text.
TABLE_NAME = re.compile(r"\[+[a-zA-Z_.]+\]+")
HEAD = """# {title}

<!-- Generated from the classes with which the file is read: do not edit, run `make docs`. -->

{text}

**Unit**: `1` is a ratio or a count; `-` has no unit. **Default**: an empty cell is a required key; `none` is a key that
may be absent, and its meaning says what applies then. Texts are in quotation marks: `parity = "even"`. The examples
have the keys that have no default.
"""

CONFIGURATION = """One TOML file, read once at the start by `fti run`, and by `fti check`, which explains it. An
unknown key, a wrong type or a value out of range is an error. [Configuration](../configuration.md) explains how the
tables work together; [`configs`](../../configs) has examples. `fti new` writes a first configuration from what the
devices send."""
DRIVERS = """The table `[device.options]` of a device in a [configuration](configuration.md) has the options of its
driver. `fti drivers NAME` prints them too, with the messages and the commands of the driver. An option that ends in
`_file` names a file, and a relative path begins at the configuration; the option without that ending then has its
text."""
SCENARIO = """One TOML file: the flight, the ground below it, and the faults. `fti hil SCENARIO` flies it, `fti check
SCENARIO` checks and explains it, `fti score` compares a session with it, and `fti hil template` prints a scenario
with every key. [Hardware in the loop](../hardware-in-the-loop.md) explains the emulator;
[`configs/scenarios`](../../configs/scenarios) has examples."""
AIRFIELD = """The TOML file of the published approach, read by `fti reference make --airfield FILE`. `fti reference
template` prints one with every key. The command writes the reference of the approach, a CSV file for `[nav.approach]
profile`."""
REFERENCE = """

## Header of a reference

`fti reference make` writes these keys into the reference of an approach, as lines `# limits.t1 = 25.5`, and `fti
reference info` prints them. They are not changed by hand: the hash of the file would no longer match. `fti reference
fit` writes a file with the keys `model`, `beam_deg`, `threshold_db`, `bias_m` and `scale` of
[`[device.altimeter]`](configuration.md#devicealtimeter)."""
FAULTS = """

## `[[fault]]`

[Faults](../faults.md) describes every kind with its keys, its flags and an example."""
PROFILE = """

## `profile`: faults as a table

The CSV file that the key `profile` names:

```text
{}
```"""
REASONS_HEAD = """# Reasons

<!-- Generated from the texts of the reasons: do not edit, run `make docs`. -->

The values of `reasons` and `unchecked` in the outputs of navigation: why a value is not valid, or why a monitor gives
no result. The text is shown in alarms, on the page and in the terminal. `fti topics Reason` prints this table.
[Fault detection](../fault-detection.md) explains the tests.
"""
LABELS = """

## ARINC 429 label sets

The TOML file that `labels_file` names. [`configs/labels`](../../configs/labels) has an example."""


def pages() -> Mapping[str, str]:
    """The text of each page by its file name."""
    texts: dict[str, Callable[[], Iterator[str]]] = {
        "configuration.md": lambda: _page("Keys of a configuration", CONFIGURATION, tables.configuration()),
        "drivers.md": _drivers,
        "scenario.md": _scenario,
        "airfield.md": _airfield,
        "reasons.md": _reasons,
    }
    return {name: "\n".join(lines()) + "\n" for name, lines in texts.items()}


def _page(title: str, text: str, found: Iterable[Table]) -> Iterator[str]:
    yield HEAD.format(title=title, text=text)
    for number, table in enumerate(found):
        yield from ("", f"## {heading(table)}", "") if number or table.head else ()
        yield from _section(table)


def _drivers() -> Iterator[str]:
    yield HEAD.format(title="Options of the drivers", text=DRIVERS).rstrip("\n")
    for name in drivers.names():
        yield from ("", f"## `{name}`", "", f"Document: {drivers.load(name).DOCUMENT}.", "")
        found = tables.driver_options(name)
        for number, table in enumerate(found):
            yield from ("", f"### `{table.head}` of `{name}`", "") if number else ()
            yield from _section(table)
        if not found:
            yield "It has no options."
    yield LABELS
    for table in tables.label_sets():
        yield from ("", f"### `{table.head}`", "", *_section(table))


def _scenario() -> Iterator[str]:
    yield from _page("Keys of a scenario", SCENARIO, tables.scenario())
    yield FAULTS
    yield PROFILE.format(inspect.getdoc(fault_table))


def _airfield() -> Iterator[str]:
    yield from _page("Keys of an airfield file", AIRFIELD, tables.airfield())
    yield REFERENCE
    for table in tables.reference_header():
        yield from (("", f"### `{table.head}`", "") if table.head else ("",))
        yield from _section(table)


def _reasons() -> Iterator[str]:
    yield REASONS_HEAD
    yield from _table(("reason", "text"), ((f"`{reason.value}`", REASONS[reason]) for reason in Reason))


def heading(table: Table) -> str:
    """The table as its heading on the page."""
    if not table.head:
        return "Keys at the top"
    return f"`{table.head}`" + (f' `kind = "{table.kind}"`' if table.kind else f" {table.title}" if table.title else "")


def _section(table: Table) -> Iterator[str]:
    yield from (table.description, "")
    yield from _table(("key", "unit", "default", "allowed", "meaning"), map(_cells, table.keys))
    if text := example(table):
        yield from ("", "```toml", text, "```")


def _cells(key: Key) -> tuple[str, ...]:
    default = f"`{key.default}`" if key.default else ""
    meaning = TABLE_NAME.sub(_section_link if key.description.startswith("[") else r"`\g<0>`", key.description)
    return (f"`{key.name}`", key.unit, default, key.limits, meaning)


def _section_link(name: re.Match[str]) -> str:
    """A link to the section of a table; the sections of several kinds begin alike."""
    if "device.options" in name[0]:
        return f"[`{name[0]}`](drivers.md)" if name[0] == "[device.options]" else f"`{name[0]}`"
    kinds = {"[[link]]": "-kind--serial", "[flight]": "-kind--approach"}
    anchor = re.sub(r"[^\w]", "", name[0].lower()) + kinds.get(name[0], "")
    return f"[`{name[0]}`](#{anchor})"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield from (f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


if __name__ == "__main__":
    for name, text in pages().items():
        file = Path(sys.argv[1]) / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text, encoding="utf-8")
