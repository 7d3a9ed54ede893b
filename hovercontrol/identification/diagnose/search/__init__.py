"""The search for missing effects: candidates, their scores, and which are named."""
