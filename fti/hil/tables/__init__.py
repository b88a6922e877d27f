"""Tables of a scenario file: strictly validated, without behaviour."""
