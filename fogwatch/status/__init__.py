"""The state of a running fleet at one look, and whether anything is wrong.

fleet_status.py   the state, as text and as JSON
from_source.py    from what a page would show: a world's feed or, with a scenario, the robots' positions
from_tokens.py    without a world and a scenario: which processes are there, and what they send
"""
