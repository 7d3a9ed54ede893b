"""How objects show themselves in a notebook: tables, typeset equations and sparklines, without any script.

The classes' ``_repr_html_`` and ``plot`` call what is here; nothing of it is imported before.
"""
