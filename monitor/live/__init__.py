"""A fleet that is running, as a source for pages and recordings."""
