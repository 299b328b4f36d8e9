"""The verdict: what must be true of an honest run, check by check, from its scenario, its journal and the exit codes.

`judge.py` goes through the journal once and asks every check; each of the others is one file's worth of checks.
"""
