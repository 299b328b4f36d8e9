"""The folder of a closed fleet: its members, their hosts and their certificates."""
