"""Deployment: a folder with which a policy drives a real car, and a report of how car and simulator differ."""
