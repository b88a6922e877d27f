"""Generator of docs/topics.md: the content of ``fti topics`` as a page.

python -m fti.messages.topics_page docs/topics.md    (or: make docs)
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from fti.messages.topic_fields import fields
from fti.messages.topics import Topic, topics

HEAD = """# Topics

<!-- Generated from the classes of the messages: do not edit, run `make docs`. -->

`fti topics` prints the list in the terminal, `fti topics TOPIC` one topic, `--json` the same for programs. Names in
angle brackets stand for names of the configuration. On the bus, a message has also `age_ms`, `max_age_ms` and `late`.

- **Files**: kinds of files of a session ([recording](architecture.md#recording)).
- **Late**: on the bus a message that is older is late, and its `valid` is false. A height above ground is late above
  `max_age_ms` of its device.
- Numbers are SI; `1` has no dimension, `unit` is in the unit that the field `unit` names. NaN is null.
"""


def page() -> str:
    """The text of the page."""
    return "\n".join(_lines(topics())) + "\n"


def _lines(found: Sequence[Topic]) -> Iterator[str]:
    yield HEAD
    yield from ("| topic | content | rate | files | bus | late above | schema |", "|---|---|---|---|---|---|---|")
    yield from map(_row, found)
    for topic in found:
        if topic.content:
            yield from _section(topic, topic.content)


def _row(topic: Topic) -> str:
    late = f"{topic.max_age_ms:g} ms" if topic.max_age_ms else ""
    bus = f"`{topic.bus}`" if topic.bus else ""
    schema = f"`{topic.schema}`" if topic.schema else ""
    cells = (f"`{topic.name}`", topic.text, topic.rate, ", ".join(topic.files), bus, late, schema)
    return f"| {' | '.join(cells)} |"


def _section(topic: Topic, content: type) -> Iterator[str]:
    yield from ("", f"## `{topic.name}`", "", "```text", inspect.getdoc(content) or "", "```", "")
    yield from ("| field | type | unit |", "|---|---|---|")
    yield from (f"| `{field.name}` | {field.type} | {field.unit} |" for field in fields(content))


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page())
