"""Messages of the service: frames, measurements, outputs and events.  Units, frames and names as in ``fti``."""
