"""From altimeter samples to validated heights above ground."""
