"""The verdict's checks: what must be true of an honest run, from its scenario, its journal and the exit codes."""
