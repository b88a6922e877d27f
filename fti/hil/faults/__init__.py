"""What goes wrong, and what the daemon must say of it."""
