"""Keys of tables: each states meaning and unit in its class; documents and templates are generated from them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, Field

#: The unit of a name, a text, a number that identifies, true or false, a table, or a list of them.
NO_UNIT = "-"
#: The unit of a ratio, a probability or a count.
ONE = "1"
#: Allowed values of a key that is a table with known keys, and of one that has such tables by name.
TABLE, TABLES_BY_NAME = "table", "table of tables by name"
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def key(description: str, unit: str, example: Any = None, instead: Any = None) -> Any:
    """Meaning and unit of a key; both are printed for users.

    example : a value for the example of the table; None: the example leaves the key out
    instead : an example that does not agree with the other examples of the table
    """
    return Field(
        description=description,
        json_schema_extra={"unit": unit} if instead is None else {"unit": unit, "instead": instead},
        examples=None if example is None else [example],
    )


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a table.

    default : as TOML; "" for a required key, "none" if the key may be absent
    example, instead : as TOML; "" if there is none
    """

    name: str
    unit: str
    default: str
    limits: str
    description: str
    example: str = ""
    instead: str = ""

    @property
    def has_section(self) -> bool:
        """Is the value a table with known keys, or several of them?"""
        return self.limits in (TABLE, TABLES_BY_NAME) or self.limits.endswith(f"each {TABLE}")


def keys_of(model: type[BaseModel]) -> tuple[Key, ...]:
    """The keys of a table, in the order of its class, without the constant ``kind`` that selects it.

    Raises KeyError for a key without meaning or unit.
    """
    schema = model.model_json_schema()
    required = schema.get("required", ())
    return tuple(
        _key(name, {"default": _made_default(model, name), **entry}, name in required)
        for name, entry in schema.get("properties", {}).items()
        if "const" not in entry or "description" in entry
    )


def _made_default(model: type[BaseModel], name: str) -> Any:
    """The default that a factory makes, which the schema does not state; None without one."""
    factory: Any = model.model_fields[name].default_factory
    return factory() if factory else None


def _key(name: str, schema: Mapping[str, Any], required: bool) -> Key:
    default, limits = schema["default"], allowed_values(schema)
    shown = {} if limits == TABLE and default is not None else default  # the keys of a table have their own defaults
    text = "" if required else "none" if default is None else toml_value(shown)
    example = toml_value(schema["examples"][0]) if "examples" in schema else ""
    instead = toml_value(schema["instead"]) if "instead" in schema else ""
    return Key(name, schema["unit"], text, limits, schema["description"], example, instead)


def toml_value(value: Any) -> str:
    """A value as TOML, tables inline."""
    if isinstance(value, Mapping):
        pairs = (f"{_toml_key(key)} = {toml_value(inner)}" for key, inner in value.items() if inner is not None)
        return f"{{ {', '.join(pairs)} }}" if value else "{}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(toml_value, value))}]"
    return json.dumps(value, ensure_ascii=False)


def _toml_key(key: str) -> str:
    return key if BARE_KEY.fullmatch(key) else json.dumps(key)


# ---------------------------------------------------------------------------------------------------- allowed values


def allowed_values(schema: Mapping[str, Any]) -> str:
    """The allowed values of a key in words, from its JSON schema."""
    if parts := schema.get("anyOf") or schema.get("oneOf"):
        texts = dict.fromkeys(allowed_values(part) for part in parts if part.get("type") != "null")
        return (", or " if any("," in text for text in texts) else " or ").join(texts)
    if "const" in schema:
        return toml_value(schema["const"])
    if "enum" in schema:
        return f"one of {', '.join(map(str, schema['enum']))}"
    return _LIMITS_OF_TYPES[schema.get("type", "object")](schema)


#: What a pattern of a text means.
_TEXTS = {
    r"^[a-z][a-z0-9_]*$": "name (lower-case letters, digits, _)",
    r"^\d{4}-\d{2}-\d{2}$": "date YYYY-MM-DD",
    r"^(\d{1,3}(\.\d{1,3}){3}|\[[0-9a-fA-F:]+\]):\d{1,5}$": "address:port",
    r"^([0-9A-Fa-f]{2} ?)*$": "bytes in hexadecimal",
    r"^\s*[0-9a-fA-F]{64}\s*$": "64 hexadecimal digits",
    r"^[0-3][0-7]{2}$": "three octal digits, 000 to 377",
    r"^[0-9A-F]{3}$": "three hexadecimal digits",
}


def _table_limits(schema: Mapping[str, Any]) -> str:
    values = next(iter(schema.get("patternProperties", {}).values()), schema.get("additionalProperties"))
    if not isinstance(values, Mapping):
        return "table of any keys" if values else TABLE
    inner = allowed_values(values)
    return TABLES_BY_NAME if inner == TABLE else f"table of names, each {inner}"


def _list_limits(schema: Mapping[str, Any]) -> str:
    if "prefixItems" in schema:
        return _fixed_list_limits(schema["prefixItems"])
    low, high = schema.get("minItems", 0), schema.get("maxItems")
    counts = {(0, None): "", (1, None): ", not empty"}.get((low, high), f" of {low} or more" if high is None else "")
    return f"list{counts or (f' of {low} to {high}' if high else '')}, each {allowed_values(schema['items'])}"


def _fixed_list_limits(items: list[Mapping[str, Any]]) -> str:
    texts = [allowed_values(item) for item in items]
    if len(set(texts)) == 1:
        return f"{len(items)} numbers, each {texts[0]}"
    return f"list of {' and '.join(texts)}"


def _number_limits(schema: Mapping[str, Any]) -> str:
    noun = "whole number" if schema["type"] == "integer" else "number"
    bounds = [
        f"{sign} {schema[name]:.12g}"
        for name, sign in (("exclusiveMinimum", ">"), ("minimum", ">="), ("exclusiveMaximum", "<"), ("maximum", "<="))
        if name in schema
    ]
    return " ".join((noun, ", ".join(bounds))).strip()


_LIMITS_OF_TYPES: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "array": _list_limits,
    "boolean": lambda _: "true or false",
    "integer": _number_limits,
    "number": _number_limits,
    "object": _table_limits,
    "string": lambda schema: _TEXTS.get(schema.get("pattern", ""), "text"),
}
