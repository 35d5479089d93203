"""`python -m kinqp.cli`, the same as `kinqp`."""

from . import main

main()
