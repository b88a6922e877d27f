"""Reference of an approach: simulated or recorded approaches, and the limits that follow from them."""
