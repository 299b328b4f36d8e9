"""How anything is measured, kept and shown."""
