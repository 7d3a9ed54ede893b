"""Unknown functions of a model of one's own: tables fitted to logs, and the forms that they may have."""
