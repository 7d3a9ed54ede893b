"""Estimation: one engine for logs and imperfect models, behind identification and the search for effects."""
