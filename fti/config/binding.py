"""From a TOML table to a model; what is wrong is one sentence with file, key path, value and what is allowed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from fti.config.tables import StrictModel
from fti.errors import ConfigError

Model = TypeVar("Model", bound=StrictModel)


def bind(model: type[Model], table: Mapping[str, Any], file: str, key: str = "") -> Model:
    """Make a model of a TOML table.  Raises ConfigError with file, key path, value and what is allowed."""
    try:
        return model.model_validate(_lists_to_tuples(table))
    except ValidationError as error:
        raise ConfigError("; ".join(_sentences(error, model, file, key))) from None


def _lists_to_tuples(value: Any) -> Any:
    """TOML has arrays where the models have tuples."""
    if isinstance(value, Mapping):
        return {k: _lists_to_tuples(v) for k, v in value.items()}
    if isinstance(value, list):
        return tuple(_lists_to_tuples(v) for v in value)
    return value


def _sentences(error: ValidationError, model: type[BaseModel], file: str, key: str) -> Iterable[str]:
    for item in error.errors():
        where = _key_path(key, item["loc"], model)
        if item["type"] == "extra_forbidden":
            known = ", ".join(sorted(_known_keys(model, item["loc"][:-1])))
            yield f"{file}: {where}: there is no such key; allowed here: {known or 'none'}"
        elif item["type"] == "missing":
            yield f"{file}: {where}: missing; it must be given"
        else:
            yield f"{file}: {where} = {_format_value(item['input'])}: {item['msg'][0].lower()}{item['msg'][1:]}"


def _key_path(key: str, loc: tuple[int | str, ...], model: type[BaseModel]) -> str:
    path, schema = key, _json_schema(model)
    node = _resolve(schema, schema)
    for part in loc:
        if part not in _kinds(node):  # which of several tables it is is not a key of the file
            path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else part
        node = _resolve(schema, _step(node, part, schema))
    return path


def _kinds(node: dict[str, Any]) -> dict[int | str, str]:
    """The tables that can stand here, by their discriminator."""
    found: dict[int | str, str] = node.get("discriminator", {}).get("mapping", {})
    return found


def _known_keys(model: type[BaseModel], loc: tuple[int | str, ...]) -> set[str]:
    """The keys of the model at a place inside another one, found through its JSON schema."""
    schema = _json_schema(model)
    node = _resolve(schema, schema)
    for part in loc:
        node = _resolve(schema, _step(node, part, schema))
    return set(node.get("properties", {})) - {"path", "text"}


@cache
def _json_schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


def _step(node: dict[str, Any], part: int | str, schema: dict[str, Any]) -> dict[str, Any]:
    if isinstance(part, int):
        items: dict[str, Any] = node.get("items", {})
        return items
    if part in _kinds(node):
        return {"$ref": _kinds(node)[part]}
    found: dict[str, Any] = node.get("properties", {}).get(part, {})
    return next((o for o in found.get("anyOf", ()) if "$ref" in o), found)


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    ref = node.get("$ref")
    if ref is None:
        return node
    target: dict[str, Any] = schema["$defs"][ref.rsplit("/", 1)[1]]
    return target


def _format_value(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
