"""Launcher of a fleet as processes of this machine, with a run folder."""
