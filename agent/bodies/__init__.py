"""Bodies: how a robot gets where its policy wants it to be."""
