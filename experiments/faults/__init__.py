"""What faults cost: the experiment and its page."""
