"""The Block and its symbolic processing; independent of solvers, file formats and vehicles."""
