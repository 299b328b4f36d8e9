"""Who may do what on the network, and how each side proves it."""
