"""The verdict's checks of robots: where they are, what they sense, and who is alive."""
