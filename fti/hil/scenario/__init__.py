"""What is flown in the laboratory, and what goes wrong."""

from fti.hil.scenario.loading import find, load, load_config, parse, shipped_names
from fti.hil.tables.schema import Scenario

__all__ = ["Scenario", "find", "load", "load_config", "parse", "shipped_names"]
