"""Every public name is had from `obseq.leastsquares`; former places still work, and say so."""

import importlib

import numpy as np
import pytest

import obseq
from obseq import errors, leastsquares


def test_every_error_is_public():
    known = {
        name
        for name, value in vars(errors).items()
        if isinstance(value, type) and issubclass(value, obseq.ObseqError)
    }
    assert known <= set(obseq.__all__)


HOMES = {name: getattr(leastsquares, name) for name in leastsquares.__all__}


def test_a_former_place_does_not_hide_the_function_of_its_name():
    importlib.import_module("obseq.leastsquares.reliability")
    system = leastsquares.LeastSquares()
    heights = system.add_scalars(["a", "b"], [0.0, 1.0])
    batch = system.add_linear([heights[[0, 0, 1, 1]]], [np.ones((4, 1))], [0.1, 0.2, 1.0, 1.4], 0.1)
    from obseq.leastsquares import reliability

    found = reliability(system, system.solve(covariance=True)).of(batch)
    assert found.redundancy.ravel() == pytest.approx([0.5] * 4)


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("losses", "Huber"),
        ("losses", "graduated"),
        ("reliability", "reliability"),
        ("snooping", "snoop"),
        ("hypothesis_tests", "global_test"),
        ("objects", "UnknownObject"),
    ],
)
def test_former_places_still_work(module, name):
    former = importlib.import_module(f"obseq.leastsquares.{module}")
    with pytest.warns(DeprecationWarning, match=f"from obseq.leastsquares import {name}"):
        assert getattr(former, name) is HOMES[name]
    with pytest.raises(AttributeError):
        former.nothing  # noqa: B018
