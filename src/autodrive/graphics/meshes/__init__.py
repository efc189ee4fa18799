"""Meshes of vehicles and maps: built from their Specs, cached as files, and exported as URDF."""
