"""Energy: batteries, and the docks where robots charge them."""
