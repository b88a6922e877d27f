"""The layers hold; the recorder imports no heavy module and no decoder."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers import ROOT

#: Modules that the recorder may import.
BYTES_ONLY = ["fti.messages", "fti.errors", "fti.clock", "fti.config", "fti.canframe", "fti.buffers", "fti.links"]
BYTES_ONLY += ["fti.buffers.triple_buffer", "fti.buffers.ring", "fti.logger.raw_log"]
HEAVY = ["numpy", "numba", "llvmlite", "scipy", "zenoh", "aiohttp", "aiomqtt", "foxglove", "pyproj", "pymavlink"]
HEAVY += ["pyarrow"]
UNDERSTANDING = ["fti.drivers", "fti.formats", "fti.nav", "fti.ranging", "fti.terrain", "fti.web", "fti.bus", "fti.hil"]

SHOW_MODULES = (
    "import importlib, json, sys; importlib.import_module(sys.argv[1]); print(json.dumps(sorted(sys.modules)))"
)


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    """A fresh interpreter in the repository that must succeed."""
    command = [sys.executable, *arguments]
    done = subprocess.run(command, check=False, cwd=ROOT, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def test_every_contract_holds() -> None:
    """The contracts are in pyproject.toml."""
    run = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    assert " 0 broken" in python("-c", run, "--no-cache").stdout


def private_imports(source: Path) -> Iterator[str]:
    """Modules and names with ``_`` that a file imports from another package than its own."""
    package = ".".join(source.relative_to(ROOT).parent.parts)
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("fti"):
            for name in node.names:
                parts = [*node.module.split("."), name.name]
                first = next((i for i, part in enumerate(parts) if part.startswith("_")), None)
                if first is not None and not f"{package}.".startswith(".".join(parts[:first]) + "."):
                    yield f"{source.relative_to(ROOT)}: {'.'.join(parts)}"


def test_no_module_imports_what_is_private_to_another_package() -> None:
    texts = [text for source in sorted((ROOT / "fti").rglob("*.py")) for text in private_imports(source)]
    assert texts == []


@pytest.mark.parametrize("module", [*BYTES_ONLY, "fti.service.recorder.__main__"])
def test_the_recorder_loads_nothing_heavy(module: str) -> None:
    loaded = set(json.loads(python("-c", SHOW_MODULES, module).stdout))
    assert module in loaded
    assert not loaded & {*HEAVY, *UNDERSTANDING}


def test_the_command_line_answers_without_the_heavy_parts() -> None:
    """``fti --help`` imports every command; what a command needs is imported when it runs."""
    import_times = python("-X", "importtime", "-m", "fti.cli.main", "--help").stderr
    imported = {line.rpartition("|")[2].strip() for line in import_times.splitlines()}
    assert "argparse" in imported
    assert not imported & set(HEAVY)


def test_no_driver_loads_what_is_slow_to_load() -> None:
    """The supervisor binds the options of every driver before anything is recorded."""
    load = "import json, sys; from fti import drivers; [drivers.load(n) for n in drivers.names()]"
    loaded = set(json.loads(python("-c", f"{load}; print(json.dumps(sorted(sys.modules)))").stdout))
    assert "fti.ranging.radar.quantise" in loaded
    assert not loaded & {"numpy", "numba", "scipy", "pyproj", "rasterio"}
