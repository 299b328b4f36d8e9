"""What robots tell each other: the position message, and what a receiver believes of it."""
