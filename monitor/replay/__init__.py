"""Replays a run from its folder."""
