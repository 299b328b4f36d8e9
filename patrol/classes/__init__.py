"""Classes that a scenario names: their files, finding them, and checking them without running them."""
