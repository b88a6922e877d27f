"""docs/reference has every key that a user sets; templates are accepted by the programs that read such files."""

from __future__ import annotations

import importlib
import pkgutil
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest

import fti
from fti import drivers
from fti.cli.main import main
from fti.config import StrictModel, bind
from fti.errors import ConfigError
from fti.hil import scenario as scenarios
from fti.hil.tables import fault_base, fault_types
from fti.nav.integrity.approach import load_airfield
from fti.user_files import tables
from fti.user_files.page import pages
from fti.user_files.tables import Table
from fti.user_files.template import commented
from tests.helpers import ROOT

FOLDER = ROOT / "docs" / "reference"
#: Length of the shortest meaning: "algorithm".
MIN_MEANING = 9
#: Unit by the last part of a key, as the conventions of names have it (fti/__init__.py).
UNITS = {
    "s": "s", "ms": "ms", "m": "m", "ft": "ft", "deg": "deg", "hz": "Hz", "mps": "m/s", "mps2": "m/s2", "mb": "MiB",
    "hpa": "hPa", "ppm": "ppm", "db": "dB", "v": "V", "k": "K", "ut": "uT", "bytes": "byte", "percent": "%",
}  # fmt: skip
#: Classes of files that programs write, and parts of others without a table of their own.
NOT_WRITTEN_BY_USERS = {
    "LinkStartup", "StorageStartup", "RecorderStartup", "NavigationStartup",
    "LinkTable", "TlsKeys", "NumberLocation", "FrameOptions", "EffectiveFault", "DeviceSettings",
}  # fmt: skip


def found_tables() -> dict[str, list[Table]]:
    """Tables by the name of their page."""
    options = [table for name in drivers.names() for table in tables.driver_options(name)]
    return {
        "configuration.md": tables.configuration(),
        "drivers.md": [*options, *tables.label_sets()],
        "scenario.md": tables.scenario(),
        "airfield.md": tables.airfield(),
    }


#: Keys that a program writes: without examples, in no template.
WRITTEN = [("airfield.md", table) for table in tables.reference_header()]
EVERY = [(page, table) for page, found in found_tables().items() for table in found]


def allowed_keys(model: type[StrictModel]) -> set[str]:
    """The keys that the reader allows: it names them when it refuses another one."""
    probe = model
    if model.model_config["extra"] == "allow":  # the models of devices refuse other keys
        probe = type(model.__name__, (model,), {"model_config": {"extra": "forbid"}})
    with pytest.raises(ConfigError) as error:
        bind(probe, {"no_such_key": 1}, "f.toml")
    (text,) = re.findall(r"no_such_key: there is no such key; allowed here: ([^;]*)", str(error.value))
    return set(text.split(", ")) - {"kind" if is_kind(model) else ""}


def is_kind(model: type[StrictModel]) -> bool:
    """Does the key ``kind`` select the class?"""
    return "kind" in model.model_fields and model.model_fields["kind"].description is None


def rows_below(page: str, table: Table) -> Iterator[tuple[dict[str, list[str]], str]]:
    """Rows by key, and the example, of each section of the table."""
    text = (FOLDER / page).read_text(encoding="utf-8")
    for section in re.split(r"^#+ ", text, flags=re.MULTILINE):
        title = section.partition("\n")[0]
        if table.description in section and (table.head in title or table.head == "[device.options]"):
            lines = [line for line in section.splitlines() if line.startswith("| `")]
            rows = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
            example = re.search(r"```toml\n(.*?)```", section, re.DOTALL)
            yield {row[0].strip("` "): row for row in rows}, example[1] if example else ""


def own_keys(table: Table, keys: set[str]) -> set[str]:
    return keys & set(table.model.__annotations__) if table.title else keys


def test_the_pages_are_up_to_date() -> None:
    for name, text in pages().items():
        assert (FOLDER / name).read_text(encoding="utf-8") == text, (
            f"docs/reference/{name} is not up to date: make docs"
        )


def test_every_key_that_binds_is_on_the_page_with_a_meaning() -> None:
    for page, table in [*EVERY, *WRITTEN]:
        keys = own_keys(table, allowed_keys(table.model))
        assert any(set(rows) == keys for rows, _ in rows_below(page, table)), (page, table.head, table.kind)
        for rows, _ in rows_below(page, table):
            assert [row for row in rows.values() if len(row) != 5 or not row[1] or len(row[4]) < MIN_MEANING] == []


def test_every_class_of_a_file_is_on_a_page() -> None:
    """A new class that is bound must be added to the pages, or to the classes that no user writes."""
    for module in pkgutil.walk_packages(fti.__path__, "fti."):  # other tests may have imported any of them
        if not module.name.startswith("fti.testing"):
            importlib.import_module(module.name)

    def below(model: type[StrictModel]) -> Iterator[type[StrictModel]]:
        for inner in model.__subclasses__():
            yield inner
            yield from below(inner)

    faults = {*get_args(get_args(fault_types.Fault)[0])}
    product = {m for m in below(StrictModel) if m.__module__.startswith("fti.")}
    bases = {m for m in product if m.__module__ in (fault_base.__name__, fault_types.__name__)}
    settings = {m for m in product if m.__module__.startswith("fti.hil.sensors") and not m.__annotations__}
    mixed = {m for m in product if m.__module__ == "fti.hil.sensors" or m.__name__ == "FittedKeys"}
    options = {m for m in product if m.__name__ == "Options" and not m.model_fields}
    named = {table.model for _, table in [*EVERY, *WRITTEN]}
    left = product - named - faults - bases - settings - mixed - options
    assert {model.__name__ for model in left} <= NOT_WRITTEN_BY_USERS


def test_units_agree_with_the_names_of_the_keys() -> None:
    checked = 0
    for _, table in EVERY:
        for key in table.keys:
            suffix = key.name.rpartition("_")[2]
            if "_" in key.name and suffix in UNITS:
                assert key.unit == UNITS[suffix], (table.model.__name__, key.name)
                checked += 1
    assert checked > 100


def test_the_examples_bind_and_the_defaults_are_those_of_the_reader() -> None:
    for page, table in EVERY:
        for rows, example in rows_below(page, table):
            if not example or set(rows) != own_keys(table, allowed_keys(table.model)):
                continue
            given = values_of(example, table)
            bound = bind(table.model, given, "example.toml")
            for name, row in rows.items():
                if name not in given and row[2]:
                    assert plain(getattr(bound, name)) == default_of(row[2], bound, name), (table.head, name)


def values_of(text: str, table: Table) -> dict[str, Any]:
    """The keys of a table in a text that has only this table."""
    value: Any = tomllib.loads(text)
    for part in re.findall(r"\w+", table.head):
        value = value[part][0] if isinstance(value[part], list) else value[part]
    return dict(value)


def plain(value: Any) -> Any:
    """A value as TOML has it."""
    if isinstance(value, StrictModel):
        return {name: plain(inner) for name, inner in value.model_dump(exclude_none=True).items()}
    if isinstance(value, tuple):
        return [plain(inner) for inner in value]
    return {name: plain(inner) for name, inner in value.items()} if isinstance(value, dict) else value


def default_of(cell: str, bound: Any, name: str) -> Any:
    """The default that a cell states; {} : a table with its own defaults."""
    if cell == "`none`":
        return None
    value = tomllib.loads(f"value = {cell.strip('`')}")["value"]
    inner = getattr(bound, name)
    return plain(type(inner)()) if value == {} and isinstance(inner, StrictModel) else value


# ------------------------------------------------------------------------------------------------------- templates


def uncommented(lines: list[str]) -> str:
    """The lines with every key that may be set."""
    return "\n".join(re.sub(r"^#(?=[a-z\[])", "", line) for line in lines)


def test_a_template_has_every_key_and_the_real_defaults() -> None:
    for _, table in EVERY:
        lines = uncommented([line.replace("NAME", "name") for line in commented([table], {})])
        sections = {key.name for key in table.keys if key.has_section}
        given = values_of(lines, Table(table.head.replace("NAME", "name"), table.model))
        kind = {"kind"} if is_kind(table.model) else set()
        assert set(given) - kind | sections == {key.name for key in table.keys}, (table.head, table.kind)
        required = {key.name for key in table.keys if not key.default}
        for key in table.keys:
            if key.name in given and key.default not in ("", "none"):
                field = table.model.model_fields[key.name]
                assert given[key.name] == plain(field.get_default(call_default_factory=True)), key.name
            elif key.name in required and key.name in given:
                assert given[key.name] == tomllib.loads(f"v = {key.example}")["v"]


def test_the_airfield_template_is_accepted_with_and_without_its_comments(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reference", "template"]) == 0
    text = capsys.readouterr().out
    assert load_airfield(text, "template.toml").leg is None
    (leg,) = load_airfield(uncommented(text.splitlines()), "template.toml").leg or ()
    assert (leg.radius_m, leg.bank_deg) == (-2000.0, 10.4)


def test_the_scenario_template_is_accepted_for_any_configuration(tmp_path: Path) -> None:
    for name, config in (("demo", None), ("uav", ROOT / "configs/uav_mavlink.toml")):
        file = tmp_path / f"{name}.toml"
        options = ["--config", str(config)] if config else []
        assert main(["hil", "template", "--out", str(file), *options]) == 0
        scenario = scenarios.load(file)
        assert scenarios.load_config(scenario).session.name
        assert scenario.model_copy(update={"title": "", "description": "", "config": ""}) == scenarios.parse(
            {"title": "", "description": "", "config": ""}, "", file
        ).model_copy(update={"config": ""})


def test_an_existing_file_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("mine")
    for command in ("hil", "reference"):
        with pytest.raises(SystemExit, match="2"):
            main([command, "template", "--out", str(file)])
        assert "already exists" in capsys.readouterr().err
    assert file.read_text() == "mine"
