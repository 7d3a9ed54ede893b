"""Evidence for named effects, and the remainder."""
