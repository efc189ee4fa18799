"""Serves the page, scene files and the native protocol on one port."""
