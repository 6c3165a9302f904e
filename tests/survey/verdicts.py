"""What tests ask of accusations: codes, lines, points; never their prose."""

UNITS = {"W100", "W101", "W106", "W107", "W125", "W126", "W127", "W128"}
MISTYPED = {"W109", "W110", "W129", "W130"}


def codes(error):
    """Code of the cause, and those of its slips."""
    return {error.code, *(slip.code for slip in error.slips)}


def lines(error):
    """Lines of the observations that it concerns."""
    return {row.line for row in error.observations}


def names(error):
    """Names of the known points that it concerns."""
    return {point.name for point in error.points}


def alternatives(error):
    """All that may be wrong in its place, itself too."""
    return [error, *error.others]


def places(errors):
    """Sets of lines, or of names of known points, that are accused."""
    return [lines(error) or names(error) for error in errors]
