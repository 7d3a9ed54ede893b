"""Craft and machines as lists of named effects: models, their files, the source documents' vehicles."""
