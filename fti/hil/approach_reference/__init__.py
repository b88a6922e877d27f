"""Making the reference of an approach: simulated or recorded approaches, and the limits that come of them."""
