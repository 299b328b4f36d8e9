"""What the sections of a scenario are made of: strict mappings, and the types of their values."""
