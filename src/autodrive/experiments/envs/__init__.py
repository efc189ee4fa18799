"""Learning environments: driving tasks for Gymnasium and PettingZoo, and adapters for learning libraries."""
