"""The verdict: what must be true of an honest run, check by check, from its scenario, its journal and the exit codes.

`judge.py` lists the checks and goes through the journal once. `common` holds what all checks share; `run`, `robots` and
`frames` hold the checks.
"""
