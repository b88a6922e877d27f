"""Statistics of a recording by topic, in constant memory."""
