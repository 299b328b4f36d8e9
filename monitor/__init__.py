"""The eyes: what a patrol looks like from outside, rebuilt from positions and from journals.

    observer    the fog of one who only listens, and beside it the truth
    runs        a run folder as arrays; replay: its state at any tick; visits, beliefs: what adds up over a run
    recording   an MCAP file for robot viewers (ros: its messages; mcapfile: one read again)
    report      one page about a run (charts, map_charts, style, html, faultbands, analysis); compare: several runs

Nothing here decides anything, and nothing that decides reads it.
"""
