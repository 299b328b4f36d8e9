"""The part of every process that is no patrol: how it starts, connects, proves its role, reports and ends.

The messages between processes and the one link to Zenoh stand here. `patrol` imports nothing of this package.
"""
