"""Names of tables from topics: a topic may be any text, a file name may not."""

from __future__ import annotations

import re
from collections.abc import Sequence

#: A name is never longer than this [B]; a file system takes 255, with the suffix.
MAX_BYTES = 120
#: What stands in a name as it is: letters and digits of any script, and these.
_UNSAFE_CHARACTERS = re.compile(r"[^\w.\-]+")


def table_names(topics: Sequence[str]) -> dict[str, str]:
    """A name for each topic, without suffix: ``/ins/attitude`` is ``ins_attitude``.

    Two topics never have the same name, also where a file system does not tell capital letters: a number follows.
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
