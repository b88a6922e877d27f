"""Tests between sources: the filter against copies of it without one of them (solution separation)."""
