"""Files written atomically, TOML tables, JSON, and models from a user's Python file."""
