"""Systems of FMUs in one file (System Structure and Parameterization 1.0 and 2.0): written and read."""
