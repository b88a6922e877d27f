"""Test a flight computer against the emulator, with pytest: fixtures that fly a scenario, and assertions on topics.

pytest finds the fixtures by itself where ``fti[testing]`` is installed (docs/test-your-flight-computer.md):

    fti_emulator        flies a scenario on ports of this machine, in a folder of the test
    fti_recorder        records what the unit under test sends
    fti_unit            starts the unit under test, and ends it
    fti_bench           the three of them, and their folder
    fti_bench_factory   makes benches for fixtures of your own, with a wider scope

The names of this module are for annotations.  Importing it loads neither the emulator nor numpy, and pytest imports it
in every project of the environment: each name is loaded when it is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fti.testing.bench import Bench
    from fti.testing.emulator import Emulator
    from fti.testing.errors import BenchError, UnitKilledWarning
    from fti.testing.flight import Flight
    from fti.testing.recorder import Recorder
    from fti.testing.unit import UnitUnderTest

__all__ = ["Bench", "BenchError", "Emulator", "Flight", "Recorder", "UnitKilledWarning", "UnitUnderTest"]
_MODULES = {
    "Bench": "bench",
    "BenchError": "errors",
    "Emulator": "emulator",
    "Flight": "flight",
    "Recorder": "recorder",
    "UnitKilledWarning": "errors",
    "UnitUnderTest": "unit",
}


def __getattr__(name: str) -> Any:
    """Load a name of ``__all__`` when it is used."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
