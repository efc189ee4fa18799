"""Experiments: campaigns, learning environments, identification, policies."""
