"""One module per published result."""
