"""Every error is public."""

import obseq
from obseq import errors


def test_every_error_is_public():
    known = {
        name
        for name, value in vars(errors).items()
        if isinstance(value, type) and issubclass(value, obseq.ObseqError)
    }
    assert known <= set(obseq.__all__)
