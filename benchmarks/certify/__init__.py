"""The active set's iterations, proved: all paths through a slice of `cartesian-error`, in exact arithmetic."""

from .agreement import Agreement, compare
from .certificate import (
    Attained,
    Certificate,
    Certificates,
    attained_again,
    certify,
    read_certificates,
    write_certificates,
)
from .cone import Condition, Decider, Tally
from .enumeration import Enumeration, Region, enumerate_paths, follow
from .method import DependentRowsError, DualMethod
from .slices import Piece, Slice, SliceError, every_bound, parse_side
from .states import drawn_states, read_state

__all__ = [
    "Agreement",
    "Attained",
    "Certificate",
    "Certificates",
    "Condition",
    "Decider",
    "DependentRowsError",
    "DualMethod",
    "Enumeration",
    "Piece",
    "Region",
    "Slice",
    "SliceError",
    "Tally",
    "attained_again",
    "certify",
    "compare",
    "drawn_states",
    "enumerate_paths",
    "every_bound",
    "follow",
    "parse_side",
    "read_certificates",
    "read_state",
    "write_certificates",
]
