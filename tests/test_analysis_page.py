"""docs/analysis.md: its commands run, and the tables and columns of its programs exist."""

from __future__ import annotations

import ast
import re
import shlex
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from fti.cli.main import main
from tests.helpers import ROOT
from tests.sessions.record import FOLDER

PAGE = (ROOT / "docs" / "analysis.md").read_text()
COMMANDS = re.findall(r"```\n(fti .*)\n```", PAGE)
PROGRAMS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
SESSION = next(FOLDER.glob("*/demonstration/*_0"))
#: Texts in the programs that are neither a file nor a column.
OTHERS = {"50ms", "_radar", "_ins"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("analysis")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for command in COMMANDS:
            words = [str(SESSION) if word == "SESSION" else word for word in shlex.split(command)]
            assert main(words[1:]) == 0
    return folder


def test_the_page_has_commands_and_programs() -> None:
    assert len(COMMANDS) == 2 and len(PROGRAMS) == 5


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_texts_of_a_program_are_files_and_their_columns(program: str, folder: Path) -> None:
    texts = {
        node.value
        for node in ast.walk(ast.parse(program))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    files = {text for text in texts if text.endswith(".parquet")}
    columns = {name for file in files for name in pq.read_schema(folder / file).names}
    assert files and texts - files - OTHERS <= columns
