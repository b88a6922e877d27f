"""Position by ranges to satellites and ground stations, and which height to believe."""
