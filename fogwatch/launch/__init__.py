"""Running a fleet as processes of this machine, and the folder that a run leaves."""
