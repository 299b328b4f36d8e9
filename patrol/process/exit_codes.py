"""Exit codes of processes and commands. 0 is success; 1 is a failure, such as an invalid verdict."""

BAD_INPUT = 2
"""The input is wrong: one line on the standard error says what, and how to mend it."""

UNKNOWN = 3
"""Result unknown: a run that could not be judged, a scenario that was too slow to tell, a crash."""

CRASHED = 70
"""A process met a mistake of ours, with a traceback."""

INTERRUPTED = 130
"""A process was asked to leave."""
