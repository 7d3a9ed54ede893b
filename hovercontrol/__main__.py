"""``python -m hovercontrol`` is the ``hovercontrol`` command."""

from hovercontrol.app.cli import main

if __name__ == "__main__":
    main()
