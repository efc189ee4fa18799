"""Vehicles: what a car is made of, and what the physics engine needs to know of it."""
