def some_call(rng):
    return lambda: None
