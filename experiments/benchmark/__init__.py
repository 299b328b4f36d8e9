"""The benchmark: policies beside each other on terrains, in teams of several sizes, under several conditions."""
