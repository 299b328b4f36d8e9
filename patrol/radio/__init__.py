"""Messages between robots: the position message, and the rules by which a receiver believes it."""
