"""Running a fleet as processes of this machine, and the run folder."""
