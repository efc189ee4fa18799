"""The rules of a world, one room for each; `rules.py` has the list that a World and a batch follow."""
