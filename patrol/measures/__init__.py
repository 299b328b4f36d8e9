"""Measures of a patrol: how long robots stay in one place, which are trapped, and the best tour as a yardstick."""
