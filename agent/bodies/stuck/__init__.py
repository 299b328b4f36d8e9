"""What a body does that gets no further: it backs off, turns, retreats, or looks for a manoeuvre."""
