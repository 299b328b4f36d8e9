"""Monitoring: shows, replays, records and reports patrols. It never influences a run.

    observation   the interface of a source; the fog from heard positions, frame counts, and faults over time
    live          sources for running fleets
    replay        a run from its folder: its state at any tick, statistics, beliefs
    page          the live page: web server and static files
    recording     MCAP files for robot viewers
    report        the report of a run, and the comparison of runs
    process       the page's process, ``python -m monitor``

Each folder imports only from those above it: page, recording and report from live, replay and observation; live and
replay from observation.
"""
