"""How many robots some ground needs: bounds, tours, and simulated fleets of each size."""
