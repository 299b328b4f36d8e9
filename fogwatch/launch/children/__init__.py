"""The processes that the launcher starts, and the messages between it and them."""
