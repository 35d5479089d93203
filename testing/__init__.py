"""A pytest plug-in that judges a formulation of one's own: iterations exactly, times as ratios."""
