"""The command `fogwatch`, one module for each group of subcommands."""
