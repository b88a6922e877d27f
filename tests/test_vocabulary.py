"""Retired words stay out: of identifiers everywhere, and of every text of the product (docs/glossary.md).

A participle is not a noun (told, said, heard), a program is neither a household (desk, stint, patience) nor a court
(evidence, excuse, witness), and a limit is MAX_ or MIN_ with its unit.
"""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers import ROOT

# fmt: off
RETIRED = frozenset((
    "told", "tells", "telling", "teller", "said", "heard", "hears", "stint", "desk", "hygiene", "patience", "bulletin",
    "belief", "believed", "doubt", "doubts", "duty", "duties", "felled", "hopeless", "wish", "wishes", "unmade",
    "strayed", "excuse", "excuses", "excused", "witness", "witnesses", "evidence", "accuse", "accused", "judgement",
))
#: Texts and keys in recordings and reports have some of them ("never heard"); IERS has a bulletin.
RETIRED_IN_TEXTS = RETIRED - {"said", "heard", "believed", "doubts", "bulletin", "duty", "excused"}
# fmt: on
RETIRED_PREFIXES = ("MOST_", "LEAST_", "LONGEST_", "PATIENCE_", "ENOUGH_")
#: Only a text with one of these may have such a name; to tokenise all others takes ten seconds.
CANDIDATE = re.compile(f"(?i:{'|'.join(sorted(RETIRED))})|{'|'.join(RETIRED_PREFIXES)}")
FOLDERS = ("fti", "tests", "benchmarks", "examples")
MAX_TERMS = 25


def sources(*folders: str) -> Iterator[Path]:
    for folder in folders:
        yield from sorted((ROOT / folder).rglob("*.py"))


def retired_names(text: str) -> set[str]:
    """Identifiers that have a retired word or prefix."""
    if not CANDIDATE.search(text):
        return set()
    names = {
        token.string for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type == tokenize.NAME
    }
    return {name for name in names if RETIRED & set(words_of(name)) or name.lstrip("_").startswith(RETIRED_PREFIXES)}


def words_of(name: str) -> list[str]:
    """The words of an identifier: ``report_toldByNobody`` -> report, told, by, nobody."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_identifier_has_a_retired_word(folder: str) -> None:
    found = {
        str(file.relative_to(ROOT)): names for file in sources(folder) if (names := retired_names(file.read_text()))
    }
    assert found == {}


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("told = 1", {"told"}),
        ("class DaemonTold: ...", {"DaemonTold"}),
        ("def is_heard_again(): ...", {"is_heard_again"}),
        ("MOST_WAITING = _LONGEST_GAP_S = 1", {"MOST_WAITING", "_LONGEST_GAP_S"}),
        ("x = 'told'  # told", set()),
        ("saidel = unsaid = almost = retold_by = 1", set()),
    ],
)
def test_a_retired_word_is_found_in_a_name(text: str, names: set[str]) -> None:
    assert retired_names(text) == names


def test_no_text_of_the_product_has_a_retired_word() -> None:
    files = [*sources("fti"), *(ROOT / "fti/web/static").glob("*.js"), *(ROOT / "fti/web/static").glob("*.html")]
    pattern = re.compile(rf"\b({'|'.join(sorted(RETIRED_IN_TEXTS))})\b", re.IGNORECASE)
    texts = [
        f"{file.relative_to(ROOT)}:{number}: {line.strip()}"
        for file in files
        for number, line in enumerate(file.read_text().splitlines(), 1)
        if pattern.search(line)
    ]
    assert texts == []


def test_the_glossary_is_short_and_sorted() -> None:
    rows = re.findall(r"^\| ([a-z][^|]*?) \|", (ROOT / "docs/glossary.md").read_text(), re.MULTILINE)
    terms = [row for row in rows if row != "term"]
    assert terms == sorted(terms, key=str.lower)
    assert 10 <= len(terms) <= MAX_TERMS
