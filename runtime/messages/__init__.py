"""The messages between processes, as bytes."""
