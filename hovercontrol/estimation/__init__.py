"""Estimation: one engine for logs and imperfect models, used by identification and by the search for effects."""
