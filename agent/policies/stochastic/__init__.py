"""The default policy: draw the next station from good plans for the whole fleet."""
