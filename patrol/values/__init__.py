"""The parts of a scenario's sections: strict mappings, and the types of their values."""
