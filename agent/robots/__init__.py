"""Robots: bodies that a mind can be put into (`agent.ports.Robot`)."""
