"""Files and text that others wrote, read within limits; and files that are written whole or not at all."""
