"""What the world knows of robots: their bodies, their motion, what they sense, and which intruders they see."""
