"""Files written atomically, TOML tables, JSON, and what a Python file of the user's defines."""
