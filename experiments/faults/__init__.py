"""The faults experiment: what faults cost, and the page of its results."""
