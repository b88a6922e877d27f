"""The ground station: several aircraft through a zenoh router, on one page and in one terminal."""
