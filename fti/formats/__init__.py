"""Formats that drivers and emulated sensors share: fields of messages, quantities, units, device times."""
