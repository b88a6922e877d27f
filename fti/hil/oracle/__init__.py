"""Oracle of the score: expected flags of each fault with deadlines, and required outputs."""
