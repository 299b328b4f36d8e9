"""The number of robots that some ground needs: bounds, tours, and simulated fleets of each size."""
