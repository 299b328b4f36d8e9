"""The verdict's checks of a run as a whole: its journal, its fog, its faults' times, its processes, its recovery."""
