def message(rng, folder):
    return 0
