"""Tests between sources: the filter beside copies of it that go without one of them (solution separation)."""
