"""A Block as an FMU: description, C sources, binaries for several platforms, one archive."""
