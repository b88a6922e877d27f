"""The interface layer: the other end of every link of the daemon's configuration."""
