"""What can be asked for wrongly of a sweep's results."""


class ReportError(ValueError):
    """A report can't be written as asked; the message says what to do."""


class CompareError(ValueError):
    """Two sweeps can't be compared as asked; the message says what to do."""
