"""Makes texts from files and devices safe for a terminal: control characters are escaped.

A topic, a name or the text of an event may contain escape sequences, newlines and direction marks.  They are written
as JSON escapes (``\\u001b``), so that they have no effect and JSON stays valid JSON.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

#: Control characters (C0, DEL, C1), line and paragraph separators, format characters of Unicode (direction, width,
#: tags) and unpaired surrogates.
_CONTROLS = re.compile(
    "[\x00-\x1f\x7f-\x9f\xad\u0600-\u0605\u061c\u06dd\u070f\u0890\u0891\u08e2\u180e\u200b-\u200f\u2028-\u202e"
    "\u2060-\u206f\ud800-\udfff\ufeff\ufff9-\ufffb\U000110bd\U000110cd\U00013430-\U0001343f\U0001bca0-\U0001bca3"
    "\U0001d173-\U0001d17a\U000e0000-\U000e007f]"
)


def escape_controls(text: str) -> str:
    """The text on one line, with every control character as ``\\uXXXX`` or ``\\n``."""
    return _CONTROLS.sub(_escape_match, text)


def escape_tree(value: Any) -> Any:
    """``escape_controls`` for every text in a JSON value."""
    if isinstance(value, str):
        return escape_controls(value)
    if isinstance(value, Mapping):
        return {escape_controls(str(key)): escape_tree(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [escape_tree(item) for item in value]
    return value


def _escape_match(match: re.Match[str]) -> str:
    character = match[0]
    return "\\u007f" if character == "\x7f" else json.dumps(character)[1:-1]
