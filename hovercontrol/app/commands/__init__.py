"""The commands of ``hovercontrol``, one file each; :mod:`.app` puts them together."""
