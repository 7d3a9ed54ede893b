"""The Block and all that is said of it in symbols: knows no solver, no file format, no craft."""
