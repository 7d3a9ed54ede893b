"""The commands of ``hovercontrol``, one file each; :mod:`hovercontrol.cli` puts them together."""
