"""``python -m hovercontrol`` is the ``hovercontrol`` command."""

from hovercontrol.cli import main

if __name__ == "__main__":
    main()
