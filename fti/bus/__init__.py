"""The bus: outputs, health and events for other processes and programs."""
