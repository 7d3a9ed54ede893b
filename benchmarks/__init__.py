"""Every figure that README states, measured: ``make benchmarks`` (or ``python -m benchmarks [NAME ...]``)."""
