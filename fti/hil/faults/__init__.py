"""What goes wrong: with values, clocks, bytes and buses."""
