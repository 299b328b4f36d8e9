"""Commands that look at maps and scenarios before anything runs."""
