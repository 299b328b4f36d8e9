"""The files that a run writes, and the messages that it shows while it goes on."""
