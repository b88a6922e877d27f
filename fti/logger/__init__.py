"""Recording: streaming MCAP writer, session folders, reading, closing what was killed, schemas."""
