"""What speaks for a named effect, and what remains."""
