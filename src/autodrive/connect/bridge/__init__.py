"""Connects a running simulation to an AutoDRIVE devkit script."""
