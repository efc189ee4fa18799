"""Sensors: each describes itself (its Spec) and measures the State."""
