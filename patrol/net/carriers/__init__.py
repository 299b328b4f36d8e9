"""Positions without Zenoh: multicast, and serial lines."""
