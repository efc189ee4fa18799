"""Maps: modules (pieces of road, lawn, boxes) that are placed and joined to form a drivable environment."""
