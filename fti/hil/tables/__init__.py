"""What may stand in a scenario: strict tables, and nothing that acts."""
