"""Model-based control of hovercraft: one symbolic definition, many faces."""
