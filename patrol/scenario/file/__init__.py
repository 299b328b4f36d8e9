"""Scenario files: read and resolved, older versions too; errors that name the line; dumped and copied into runs."""
