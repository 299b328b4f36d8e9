"""The robots' processes as the world drives them: tick by tick, from the first to the last."""
