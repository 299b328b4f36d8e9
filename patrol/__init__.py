"""What a patrol is, shared by everything else: terrain and static fields, fog and footprint, the
position message, the scenario, the journal's format, and the one link to Zenoh. It starts nothing and
decides nothing, and it imports none of the other packages."""
