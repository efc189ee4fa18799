"""General tools: arrays, rotations, errors, reading files, caches, compilation."""
