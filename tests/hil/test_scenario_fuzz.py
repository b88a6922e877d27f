"""Whatever stands in a scenario or a table, it is read or refused in a sentence: never anything else is raised."""

from __future__ import annotations

import contextlib
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from fti import config
from fti.config import Config, StrictModel
from fti.errors import ConfigError, MissingError
from fti.example_files import SCENARIOS
from fti.hil.scenario import Scenario, load, shipped_names
from fti.hil.scenario.config_check import check
from fti.hil.scenario.fault_table import KINDS, parse
from fti.hil.scenario.fault_table_csv import COLUMNS
from fti.hil.tables.fault_types import FaultKind

REFUSED = contextlib.suppress(ConfigError, MissingError)
NUMBERS = st.one_of(st.floats(), st.integers(), st.sampled_from([0, 1, -1, 10**400, 2**63, float("nan"), float("inf")]))
WORDS = st.sampled_from(
    ["altimeter", "ins", "air_can", "*", "a+b", "", "end", "true", "range.slant_range", "altimeter.range.slant_range",
     "/nav/x.y", "unlocked", "share=1", "visibility_m=3;echo_m=1|2", "flags=|", "=", ";", "1e400", "nan", "\0",
     "9" * 5000, *FaultKind, *COLUMNS]
)  # fmt: skip
CELLS = st.one_of(WORDS, NUMBERS.map(str), st.text(max_size=8))


@cache
def keys() -> list[str]:
    """Every key that a scenario can have."""
    models: list[type[StrictModel]] = [Scenario, *KINDS.values()]
    return sorted({key for model in models for key in model.model_fields} | {"kind", "from_s", "to_s"})


@cache
def demo() -> Config:
    """The configuration of the shipped scenarios."""
    return config.load(SCENARIOS.parent / "demo.toml")


#: Of the shipped scenarios, as they were when the tests began.
TEXTS = [(SCENARIOS / f"{name}.toml").read_text() for name in shipped_names()]
VALUES = st.recursive(
    st.one_of(WORDS, NUMBERS, st.booleans(), st.none(), st.text(max_size=8)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.one_of(st.sampled_from(keys()), st.text(max_size=5)), inner)
    ),
    max_leaves=5,
)
FAULTS = st.builds(
    lambda kind, table: {**table, "kind": kind},
    st.sampled_from(FaultKind).map(str),
    st.dictionaries(st.sampled_from(keys()), st.one_of(NUMBERS, WORDS, VALUES), max_size=5),
)


@given(st.text())
def test_a_table_of_anything(text: str) -> None:
    with REFUSED:
        parse(text, "p.csv")


@given(st.lists(st.lists(CELLS, max_size=9), max_size=6), st.permutations(COLUMNS))
def test_a_table_of_cells_that_could_be_right(cells: list[list[str]], header: list[str]) -> None:
    rows = [",".join(f'"{cell.replace(chr(34), chr(34) * 2)}"' for cell in row) for row in cells]
    with REFUSED:
        parse("\n".join([",".join(header), *rows]), "p.csv")


@given(st.lists(st.tuples(st.integers(0, 9), WORDS, CELLS, st.sampled_from([*KINDS, "end", ""])), max_size=8))
def test_a_table_of_rows_that_are_nearly_right(rows: list[tuple[int, str, str, str]]) -> None:
    lines = [f'{t},"{channel}","{value}",{fault}' for t, channel, value, fault in sorted(rows)]
    with REFUSED:
        parse("\n".join(["time,channel,value,fault", *lines]), "p.csv")


@given(st.dictionaries(st.sampled_from(keys()), VALUES, max_size=3), st.lists(FAULTS, max_size=3))
def test_a_scenario_of_anything(table: dict[str, Any], faults: list[dict[str, Any]]) -> None:
    whole = {"title": "x", "description": "", "config": "none.toml", "fault": faults, **table}
    with REFUSED:
        config.bind(Scenario, whole, "s.toml")


@given(data=st.data())
def test_a_shipped_scenario_with_a_piece_of_another_text_in_it(tmp_path_factory: Any, data: st.DataObject) -> None:
    """The file beside the shipped ones, so that what it names is there."""
    text = data.draw(st.sampled_from(TEXTS))
    begin = data.draw(st.integers(0, len(text)))
    end = min(begin + data.draw(st.integers(0, 12)), len(text))
    piece = data.draw(st.one_of(st.text(max_size=12), WORDS, NUMBERS.map(str)))
    file: Path = tmp_path_factory.getbasetemp() / "scenario.toml"
    changed = (text[:begin] + piece + text[end:]).replace('"../', f'"{SCENARIOS.parent}/')
    file.write_bytes(changed.encode("utf-8", "surrogatepass"))
    with REFUSED:
        check(load(file), demo())
