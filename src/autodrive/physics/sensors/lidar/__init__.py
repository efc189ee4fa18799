"""2D LIDARs: exact ranges at one instant or in a turn, and what noise and weather do to them."""
