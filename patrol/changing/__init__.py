"""Ground of which parts close and open: sight and bodies there, and what robots can still get to see."""
