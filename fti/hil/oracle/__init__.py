"""What the daemon must say of each fault, and how soon."""
