"""What robots do besides patrolling, on the same positions and paths (paper, "Integration with other behaviour")."""
