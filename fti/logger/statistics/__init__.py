"""Survey: what a recording holds, topic by topic, in a fixed memory."""
