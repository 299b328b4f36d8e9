"""The verdict's checks of frames: as they are sent, carried and taken in by receivers."""
