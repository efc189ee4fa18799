"""Vehicles: Spec, MJCF body for the engine, and parameter tables of the Model."""
