"""Sweeps that come with the library, as TOML: `kinqp sweep configs/NAME.toml` finds them wherever it is run."""
