"""Evidence for a named effect, and what remains."""
