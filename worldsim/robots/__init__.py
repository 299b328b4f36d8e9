"""The robots in the world: their bodies, their motion, their senses, and which intruders they see."""
