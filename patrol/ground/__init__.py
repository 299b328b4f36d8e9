"""The ground: terrains and maps, where a body fits, what it sees, and the fog over it."""
