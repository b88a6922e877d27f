"""The process that sends outputs to other programs."""
