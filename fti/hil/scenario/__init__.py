"""Scenarios: the flight, its faults and its expectations, from files."""

from fti.hil.scenario.loading import find, load, load_config, parse, shipped_names
from fti.hil.tables.schema import Scenario

__all__ = ["Scenario", "find", "load", "load_config", "parse", "shipped_names"]
