"""The tour: all robots follow one short round, evenly spaced."""
