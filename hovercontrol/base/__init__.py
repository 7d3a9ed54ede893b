"""What everything else uses: errors, checks of arguments, files, tables, HTML.

Imports no other room. Begin with ``errors.py`` (one-line errors) and ``boundary.py`` (``@checked``);
``written.py`` writes files atomically, ``endings.py`` stops on signals, ``progress.py`` shows progress.
"""
