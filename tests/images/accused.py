"""What a block, or the error of one that has no solution, accuses."""

from obseq.errors import ObseqError
from obseq.images.diagnosing.diagnosis import diagnosed
from obseq.images.diagnosing.refusals import explained


def diagnosis(block, **options):
    """The record of what is wrong with a block."""
    given = block.poses
    with explained(block, **options):
        block.initialise()
        solution = block.solve(**options)
    return diagnosed(solution, given, **options)


def said(block, **options):
    """What is told of a block, with its result or with the error of one without; a line each."""
    try:
        return "\n".join(one.text for one in diagnosis(block, **options).accused)
    except ObseqError as error:
        return str(error)


def codes(block, **options):
    """Codes of the causes and names of what is accused, with the codes of slips."""
    found = diagnosis(block, **options)
    return {(one.code, one.what): {slip.code for slip in one.slips} for one in found.accused}
