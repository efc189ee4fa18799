"""Traffic: cars that drive themselves on the lanes of the map."""
