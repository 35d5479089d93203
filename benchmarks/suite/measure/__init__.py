"""What the speed suite measures with: states, clocks, references. Not part of the library."""
