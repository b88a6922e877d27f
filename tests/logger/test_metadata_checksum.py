"""The checksum of the metadata: every change of a table is found, and a file without one is left in peace."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from fti.logger.metadata_checksum import CHECKSUM_KEY, changed_tables, with_checksums

TABLES = {"fti.file": {"kind": "raw", "number": "0"}, "fti": {"origin": "hil"}, "fti.links": {"ins": "udp"}}
WHOLE = with_checksums("fti.file", TABLES)


def test_what_is_as_it_was() -> None:
    assert changed_tables("fti.file", WHOLE) == []
    assert list(WHOLE) == ["fti", "fti.links", "fti.file"]
    assert WHOLE["fti"] == TABLES["fti"]
    assert {key for key in WHOLE["fti.file"] if key.startswith(CHECKSUM_KEY)} == {
        "crc32",
        "crc32_fti",
        "crc32_fti.links",
    }


def test_a_file_that_breaks_off_between_its_tables_is_not_altered() -> None:
    for written in range(len(WHOLE) + 1):
        assert changed_tables("fti.file", dict(list(WHOLE.items())[:written])) == []


def test_a_file_without_checksums_is_not_checked() -> None:
    assert changed_tables("fti.file", TABLES) == []
    assert changed_tables("fti.file", {"truth": {"a": "b"}}) == []


def test_another_table_may_be_added() -> None:
    assert changed_tables("fti.file", {**WHOLE, "fti.packed": {"by": "me"}}) == []


@given(name=st.sampled_from(list(WHOLE)), choice=st.integers(0, 20), text=st.text(min_size=1, max_size=4))
def test_every_changed_value_is_found(name: str, choice: int, text: str) -> None:
    table = dict(WHOLE[name])
    key = list(table)[choice % len(table)]
    table[key] += text
    assert changed_tables("fti.file", {**WHOLE, name: table})


@given(name=st.sampled_from(list(WHOLE)))
def test_a_table_that_is_gone_or_renamed_is_found(name: str) -> None:
    others = {key: table for key, table in WHOLE.items() if key != name}
    assert changed_tables("fti.file", {**others, name + "x": WHOLE[name]})


@given(choice=st.integers(0, 20))
def test_a_key_that_is_changed_is_found(choice: int) -> None:
    table = WHOLE["fti.file"]
    key = list(table)[choice % len(table)]
    changed = {("x" + k if k == key else k): value for k, value in table.items()}
    assert changed_tables("fti.file", {**WHOLE, "fti.file": changed})
