"""The files of a release agree with each other, and every file that others made is listed with its licence."""

from __future__ import annotations

import re
import tomllib

from tests.helpers import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
THIRD_PARTY = (ROOT / "THIRD_PARTY.md").read_text(encoding="utf-8")
#: Kinds of files that the project cannot have written by hand, or that stand in a folder of foreign files.
FOREIGN = ("fti/**/*.npz", "fti/**/*.woff2", "fti/web/static/vendor/*/*", "fti/geodesy/*.txt", "tests/captures/*.log")


def test_version_and_date_are_the_same_everywhere() -> None:
    newest = re.search(r"^## (\S+), (\S+)$", CHANGELOG, re.MULTILINE)
    cited = re.findall(r"^(?:version|date-released): (\S+)$", CITATION, re.MULTILINE)
    assert newest and cited == [newest[1], newest[2]]
    assert PROJECT["version"] == newest[1]
    assert f"license: {PROJECT['license']}" in CITATION
    for name in ("fti-{}-py3-none-any.whl", "fti_{}_amd64.deb"):
        assert name.format(newest[1]) in (ROOT / "docs" / "installation.md").read_text(encoding="utf-8")


def test_every_foreign_file_is_listed_and_every_listed_file_exists() -> None:
    listed = [path for row in re.findall(r"^\| (`.*?) \|", THIRD_PARTY, re.MULTILINE) for path in row.split("`")[1::2]]
    assert len(listed) > 8 and all((ROOT / path).exists() for path in listed)
    foreign = [str(file.relative_to(ROOT)) for pattern in FOREIGN for file in ROOT.glob(pattern)]
    assert len(foreign) > 12
    assert [file for file in foreign if not file.startswith(tuple(listed))] == []


def test_a_licence_that_stands_beside_a_file_is_part_of_the_packages() -> None:
    shipped = {file for pattern in PROJECT["license-files"] for file in ROOT.glob(pattern)}
    assert shipped >= {*(ROOT / "fti").rglob("*LICENSE*")} | {ROOT / "LICENSE", ROOT / "THIRD_PARTY.md"}
