"""Memory that a process gives back or keeps."""
