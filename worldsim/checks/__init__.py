"""The verdict's checks of the rules that an honest run keeps, from its scenario, its journal and the exit codes."""
