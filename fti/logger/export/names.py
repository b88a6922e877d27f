"""File names of tables from topics, which may be any text."""

from __future__ import annotations

import re
from collections.abc import Sequence

#: Length limit of a name [B]; file systems allow 255, with the suffix.
MAX_BYTES = 120
#: Characters other than letters and digits of any script, ``_``, ``.`` and ``-``.
_UNSAFE_CHARACTERS = re.compile(r"[^\w.\-]+")


def table_names(topics: Sequence[str]) -> dict[str, str]:
    """A name for each topic, without suffix: ``/ins/attitude`` is ``ins_attitude``.

    A number makes the names unique, also on file systems that ignore case.
    """
    names: dict[str, str] = {}
    taken: set[str] = set()
    for topic in topics:
        name = plain = _file_name(topic)
        number = 1
        while name.casefold() in taken:
            number += 1
            name = f"{plain}_{number}"
        taken.add(name.casefold())
        names[topic] = name
    return names


def _file_name(topic: str) -> str:
    safe = _UNSAFE_CHARACTERS.sub("_", topic.strip("/").replace("/", "_"))
    name = safe.encode()[:MAX_BYTES].decode(errors="ignore")
    return name if name[:1] not in ("", ".", "-") else f"topic{name}"
