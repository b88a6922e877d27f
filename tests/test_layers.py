"""The layers hold; the recorder imports no heavy module and no decoder; studies depend in one direction."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest

from fti import study
from tests.helpers import ROOT

#: Modules that the recorder may import.
BYTES_ONLY = ["fti.messages", "fti.errors", "fti.clock", "fti.config", "fti.canframe", "fti.buffers", "fti.links"]
BYTES_ONLY += ["fti.buffers.triple_buffer", "fti.buffers.ring", "fti.logger.raw_log"]
HEAVY = ["numpy", "numba", "llvmlite", "scipy", "zenoh", "aiohttp", "foxglove", "pyproj", "pymavlink"]
HEAVY += ["pyarrow"]
UNDERSTANDING = ["fti.drivers", "fti.formats", "fti.nav", "fti.ranging", "fti.terrain", "fti.web", "fti.bus", "fti.hil"]

#: The parts of a study whose modules each part may import.  ``faults.curve`` is a command of its own.
STUDY_PARTS = {"experiment": {"experiment"}, "judge": {"judge", "experiment"}, "plots": {"plots", "experiment"}}
STUDY_COMMANDS = {f"fti.study.{name}" for name in [*study.names(), "faults.curve"]}
FIGURES = {"matplotlib.axes", "matplotlib.figure"}

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


def module_name(source: Path) -> str:
    """The name by which a file of the product is imported."""
    parts = source.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_modules(name: str, source: Path, modules: Collection[str]) -> set[str]:
    """The modules that a module imports: at its top, in functions and for types."""
    found = set[str]()
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            members = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= members & {*modules} | ({node.module} if members - {*modules} else set())
    return found & {*modules} - {name}


def circles(imports: dict[str, set[str]]) -> list[list[str]]:
    """Groups of modules each of which leads to all others of the group."""
    reached = {name: set(found) for name, found in imports.items()}
    for middle, beyond in reached.items():
        for found in reached.values():
            if middle in found:
                found.update(beyond)
    groups = {frozenset(other for other in found if name in reached[other]) for name, found in reached.items()}
    return sorted(sorted(group) for group in groups if group)


def test_no_modules_import_each_other_in_a_circle() -> None:
    """A circle has no first module to read, and none of its modules can be used or moved alone."""
    sources = {module_name(source): source for source in (ROOT / "fti").rglob("*.py")}
    found = circles({name: imported_modules(name, source, sources) for name, source in sources.items()})
    assert found == []


def study_part(module: str) -> str:
    """What is neither the judge nor the plots of a study is its experiment."""
    name = module.split(".")[3] if module.startswith("fti.study.") and module.count(".") > 2 else ""
    return "plots" if module in FIGURES else name if name in STUDY_PARTS else "experiment"


def test_judge_and_plots_of_a_study_import_its_experiment_and_nothing_imports_them() -> None:
    sources = {module_name(source): source for source in (ROOT / "fti" / "study").rglob("*.py")}
    assert {f"fti.study.{name}.{part}" for name in study.names() for part in ("experiment", "judge")} <= set(sources)
    wrong = [
        f"{name}: {module}"
        for name in sorted(set(sources) - STUDY_COMMANDS - {"fti.study"})
        for module in sorted(imported_modules(name, sources[name], {*sources, *FIGURES}))
        if module in STUDY_COMMANDS or study_part(module) not in STUDY_PARTS[study_part(name)]
    ]
    assert wrong == []


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
