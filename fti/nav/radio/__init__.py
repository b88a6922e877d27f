"""Position from ranges to satellites and ground stations, and selection of the altitude source."""
