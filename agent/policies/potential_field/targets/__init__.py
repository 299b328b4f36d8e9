"""Where to go, and for how long to keep to it: commitment, and the ground near a robot."""
