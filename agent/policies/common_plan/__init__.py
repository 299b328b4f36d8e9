"""The common plan: what all robots work out alike, and take their parts in."""
