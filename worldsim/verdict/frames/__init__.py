"""The verdict's checks of frames: what was sent, what became of it, and what receivers made of it."""
