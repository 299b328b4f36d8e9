"""The robots in the world: their bodies, their motion, what they sense, and which intruders they see."""
