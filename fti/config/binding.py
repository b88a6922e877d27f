"""Converts a TOML table to a model; an error is one sentence with file, key path, value and allowed values."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from fti.config.endpoints import ENDPOINT_PATTERN
from fti.config.publish_tables import AIRCRAFT_PATTERN, ROUTER_PATTERN
from fti.config.strict_model import StrictModel
from fti.config.tables import DATE_PATTERN, NAME_PATTERN
from fti.errors import ConfigError, did_you_mean, similar_name

Model = TypeVar("Model", bound=StrictModel)
#: What a text must be, by its pattern.
PATTERNS = {
    NAME_PATTERN: "must be lower-case letters, digits and _, a letter first",
    ENDPOINT_PATTERN: "must be ADDRESS:PORT, such as '192.168.10.1:4000'",
    AIRCRAFT_PATTERN: "must be at most 32 letters, digits, _ and -, a letter or digit first",
    ROUTER_PATTERN: "must be tcp/HOST:PORT or tls/HOST:PORT, such as 'tls/ground:7447'",
    DATE_PATTERN: "must be YYYY, YYYY-MM or YYYY-MM-DD",
}
#: The command that describes the kinds of a table, by the name of the table.
COMMAND_OF_KINDS = {"fault": "fti hil --faults"}


def bind(model: type[Model], table: Mapping[str, Any], file: str, key: str = "") -> Model:
    """Make a model of a TOML table.  Raises ConfigError with file, key path, value and allowed values."""
    try:
        return model.model_validate(_lists_to_tuples(table))
    except ValidationError as error:
        raise ConfigError("; ".join(_sentences(error, model, file, key))) from None


def _lists_to_tuples(value: Any) -> Any:
    """Convert arrays of TOML to the tuples of the models."""
    if isinstance(value, Mapping):
        return {k: _lists_to_tuples(v) for k, v in value.items()}
    if isinstance(value, list):
        return tuple(_lists_to_tuples(v) for v in value)
    return value


def _sentences(error: ValidationError, model: type[BaseModel], file: str, key: str) -> Iterable[str]:
    misspelt = _misspelt_keys(error, model)
    for item in error.errors():
        where = _key_path(key, item["loc"], model)
        if item["type"] == "too_short" and _has_wrong_entry(error, item["loc"]):
            continue  # the validator counts the right entries only
        if item["type"] == "extra_forbidden":
            known = sorted(_known_keys(model, item["loc"][:-1]))
            hint = did_you_mean(str(item["loc"][-1]), known)
            yield f"{file}: {where}: there is no such key; allowed here: {', '.join(known) or 'none'}{hint}"
        elif item["type"] == "missing":
            if item["loc"] not in misspelt:  # the error of the misspelt key names it
                yield f"{file}: {where}: missing; it must be given"
        elif item["type"] == "union_tag_invalid":
            yield f"{file}: {_unknown_kind(where, item)}"
        elif item["type"] == "union_tag_not_found":
            yield f"{file}: {where}.{_discriminator(item)}: missing; it must be given"
        else:
            yield f"{file}: {where} = {_format_value(item['input'])}: {_message(item)}"


def _message(item: ErrorDetails) -> str:
    """What is wrong with a value."""
    context = item.get("ctx", {})
    if item["type"] == "value_error":  # of a validator of ours; pydantic puts its name of the error in front
        return str(context["error"])
    return PATTERNS.get(context.get("pattern", "")) or item["msg"][0].lower() + item["msg"][1:]


def _has_wrong_entry(error: ValidationError, loc: tuple[int | str, ...]) -> bool:
    """Whether there is an error of an entry of the list at a place."""
    return any(len(item["loc"]) > len(loc) and item["loc"][: len(loc)] == loc for item in error.errors())


def _misspelt_keys(error: ValidationError, model: type[BaseModel]) -> set[tuple[int | str, ...]]:
    """The keys that the errors of unknown keys propose."""
    return {
        (*item["loc"][:-1], name)
        for item in error.errors()
        if item["type"] == "extra_forbidden"
        for name in similar_name(str(item["loc"][-1]), sorted(_known_keys(model, item["loc"][:-1])))
    }


def _unknown_kind(where: str, item: ErrorDetails) -> str:
    """The sentence about a table of an unknown kind: a similar kind, and all of them or the command that lists them."""
    kind, known = item["ctx"]["tag"], re.findall(r"'([^']*)'", item["ctx"]["expected_tags"])
    command = COMMAND_OF_KINDS.get(where.split("[", maxsplit=1)[0])
    where_known = f"; {command} lists them" if command else f"; allowed: {', '.join(known)}"
    return f"{where}.{_discriminator(item)}: unknown kind {kind!r}{did_you_mean(kind, known)}{where_known}"


def _discriminator(item: ErrorDetails) -> str:
    """The key that decides the kind of a table."""
    return str(item["ctx"]["discriminator"]).strip("'")


def _key_path(key: str, loc: tuple[int | str, ...], model: type[BaseModel]) -> str:
    path, schema = key, _json_schema(model)
    node = _resolve(schema, schema)
    for part in loc:
        if part not in _kinds(node):  # the kind of a table is not a key of the file
            path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else part
        node = _resolve(schema, _step(node, part, schema))
    return path


def _kinds(node: dict[str, Any]) -> dict[int | str, str]:
    """The possible tables here, by their discriminator."""
    kinds: dict[int | str, str] = node.get("discriminator", {}).get("mapping", {})
    return kinds


def _known_keys(model: type[BaseModel], loc: tuple[int | str, ...]) -> set[str]:
    """The keys of the model at a path inside another model, from its JSON schema."""
    schema = _json_schema(model)
    node = _resolve(schema, schema)
    for part in loc:
        node = _resolve(schema, _step(node, part, schema))
    return set(node.get("properties", {}))


@cache
def _json_schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


def _step(node: dict[str, Any], part: int | str, schema: dict[str, Any]) -> dict[str, Any]:
    if isinstance(part, int):
        items: dict[str, Any] = node.get("items", {})
        return items
    if part in _kinds(node):
        return {"$ref": _kinds(node)[part]}
    value: dict[str, Any] = node.get("properties", {}).get(part, {})
    return next((o for o in value.get("anyOf", ()) if "$ref" in o), value)


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    ref = node.get("$ref")
    if ref is None:
        return node
    target: dict[str, Any] = schema["$defs"][ref.rsplit("/", 1)[1]]
    return target


def _format_value(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
