"""pytest loads the plugin in every project of the environment: it must cost nothing there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

HEAVY = {"numpy", "numba", "pydantic", "pymavlink", "asyncio", "fti.hil", "fti.service", "fti.nav", "fti.config"}
HEAVY |= {"fti.logger", "fti.post", "fti.drivers", "pytest_asyncio", "xdist"}
SHOW = "import json, sys\ndef pytest_sessionfinish(): print('MODULES', json.dumps(sorted(sys.modules)))\n"
TEST = "def test_nothing(): pass\n"


def modules_after(code: str) -> set[str]:
    command = [sys.executable, "-c", f"{code}; import json, sys; print(json.dumps(sorted(sys.modules)))"]
    return set(json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout))


def test_importing_the_package_loads_nothing_of_the_laboratory() -> None:
    loaded = modules_after("import fti.testing")
    assert "fti.testing" in loaded
    assert not loaded & (HEAVY | {"pytest"})


def test_its_names_are_loaded_when_they_are_used() -> None:
    assert "fti.testing.bench" in modules_after("from fti.testing import Bench")
    assert "numpy" in modules_after("from fti.testing import Flight")


def test_every_name_is_there() -> None:
    names = "import fti.testing; [getattr(fti.testing, name) for name in fti.testing.__all__]"
    assert "fti.testing.unit" in modules_after(names)
    with pytest.raises(ImportError, match="Bank"):
        exec("from fti.testing import Bank")


def test_a_project_that_uses_no_fixture_loads_nothing_either(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(SHOW)
    (tmp_path / "test_it.py").write_text(TEST)
    environment = os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTEST_ADDOPTS": ""}
    command = [sys.executable, "-m", "pytest", "-s", "-p", "fti.testing.plugin"]
    for how in ([], ["--collect-only"]):
        done = subprocess.run(
            [*command, *how], check=False, cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
        (line,) = [line for line in done.stdout.splitlines() if "MODULES" in line]
        loaded = set(json.loads(line.partition("MODULES ")[2]))
        assert "fti.testing.plugin" in loaded
        assert not loaded & HEAVY


def test_pytest_finds_it_by_its_entry_point(pytestconfig: pytest.Config) -> None:
    (found,) = [one for one in entry_points(group="pytest11") if one.value == "fti.testing.plugin"]
    assert pytestconfig.pluginmanager.has_plugin(found.name)
