"""The command ``hovercontrol``, the cockpit, animations and JSON Schemas: what a user starts.

May import every other room. Begin with ``cli.py`` (errors and exit statuses) and ``commands/app.py`` (the
list of commands); a command reads arguments, calls the package and prints. ``cockpit/server.py`` serves the
page on which a craft is flown; ``animation/animate.py`` draws a motion.
"""
