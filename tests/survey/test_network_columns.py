"""What errors do to the equations of a network, and networks that are adjusted without them."""

from dataclasses import replace

import numpy as np
import pytest
from polar_network import network

from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Change
from obseq.records.diagnosis import DiagnosisRecord
from obseq.survey.diagnosing.snooping import Snooped
from obseq.survey.fieldwork import Fieldwork

SIGMAS = np.array([1e-5, 1e-4, 2e-3, 1e-3])
"""Of a direction, a zenith angle, a distance, a height difference: in turn, for each sight."""


@pytest.fixture
def seen(monkeypatch):
    """The model that the diagnosis of a network is asked about, and its adjustment."""

    def model_of(net):
        found = []
        none = Snooped(DiagnosisRecord("undecided", 0.0, 0, (), "nobody looked"), POLICY)
        monkeypatch.setattr(Fieldwork, "_judged", lambda _, model, *__: found.append(model) or none)
        adjustment = net.adjust()
        return found[0], adjustment

    return model_of


def changed(net, rows=(), by=0.0, **fields):
    observations = net.book.observations
    values = observations.values.copy()
    values[list(rows)] += by
    observations = replace(observations, values=values, **fields)
    return replace(net, book=replace(net.book, observations=observations))


def noisy(net, seed=3):
    noise = np.tile(SIGMAS, 20) * np.random.default_rng(seed).normal(size=80)
    return changed(net, range(80), noise)


def by_code(model, code):
    return [i for i in range(len(model.hypotheses)) if model.hypotheses.code(i) == code]


def test_an_observation_is_off_by_one_over_its_sigma(seen):
    model, _ = seen(noisy(network()))
    linear, columns = model.linearised(model.solution(), ())
    rows = [i for i in range(len(model.hypotheses)) if len(model.catalogue.named(i).rows) == 1][:80]
    for index in rows:
        named = model.catalogue.named(index)
        own = columns.effect(model.hypotheses.of(index), np.ones(1))
        assert np.count_nonzero(own) == 1 and own.min() == pytest.approx(
            -1.0 / np.tile(SIGMAS, 20)[named.rows[0]]
        )
    assert len(rows) == 80 and linear.residuals @ linear.residuals == pytest.approx(model.solved[1].cost)


@pytest.mark.parametrize("code", ["S130", "S131"])
def test_a_height_that_is_taken_off_changes_equations_by_its_column(seen, code):
    model, _ = seen(noisy(network()))
    place = model.solution()
    linear, columns = model.linearised(place, ())
    before = linear.residuals.copy()
    found = by_code(model, code)
    assert len(found) >= 5
    for index in found[::3]:
        own = columns.effect(model.hypotheses.of(index), np.array([1e-4]))
        without, _ = model.linearised(place, [Change(index, np.array([1e-4]), np.array([1e-4]))])
        np.testing.assert_allclose(before - without.residuals, own, atol=1e-4 * np.abs(own).max())
        assert own.any()


def of_rows(model, code, rows):
    """The hypothesis of a code that concerns some observations, and no others."""
    found = [i for i in by_code(model, code) if model.catalogue.named(i).rows.tolist() == list(rows)]
    assert len(found) == 1
    return found[0]


def coordinates_without(model, index, size):
    place, converged, iterations = model.adjusted(
        model.solution(), [Change(index, np.atleast_1d(size), np.ones(np.size(size)))]
    )
    assert converged and iterations > 0
    return place.coordinates


@pytest.mark.parametrize(
    ("code", "rows", "size"),
    [("S150", range(18, 32, 4), 0.03), ("S140", range(17, 32, 4), 2e-3), ("S150", range(2, 80, 4), 0.03)],
)
def test_what_values_share_is_taken_off_them(seen, code, rows, size):
    clean = noisy(network())
    _, wanted = seen(clean)
    model, wrong = seen(changed(clean, rows, size))
    found = coordinates_without(model, of_rows(model, code, rows), size)
    np.testing.assert_allclose(found, wanted.points.coordinates, atol=1e-6)
    assert np.abs(wrong.points.coordinates - wanted.points.coordinates).max() > 1e-4


def test_a_share_of_values_is_taken_off_them(seen):
    clean = noisy(network("AB"))
    lengths = [r for r in range(80) if r % 4 == 2]
    _, wanted = seen(clean)
    model, _ = seen(changed(clean, lengths, 3e-4 * clean.book.observations.values[lengths]))
    found = coordinates_without(model, of_rows(model, "S151", lengths), 3e-4)
    np.testing.assert_allclose(found, wanted.points.coordinates, atol=1e-4)  # the share is of values as read


def test_an_observation_that_is_wrong_is_left_out(seen):
    clean = noisy(network())
    active = np.arange(80) != 66  # a distance from P
    _, wanted = seen(changed(clean, active=active))
    model, _ = seen(changed(clean, [66], 0.2))
    index = of_rows(model, model.hypotheses.code(0), [66])
    np.testing.assert_allclose(coordinates_without(model, index, 0.2), wanted.points.coordinates, atol=1e-6)


def test_a_known_coordinate_that_is_wrong_is_an_unknown(seen):
    clean = noisy(network())
    coordinates = clean.points.coordinates.copy()
    coordinates[1, 0] += 0.3
    sigmas = clean.points.sigmas.copy()
    sigmas[1, 0] = 1e6
    _, wanted = seen(replace(clean, points=replace(clean.points, sigmas=sigmas)))
    model, _ = seen(replace(clean, points=replace(clean.points, coordinates=coordinates)))
    (index,) = [i for i in range(len(model.hypotheses)) if model.catalogue.named(i).known == ((1, 0),)]
    np.testing.assert_allclose(coordinates_without(model, index, 0.3), wanted.points.coordinates, atol=1e-5)


def test_contradictions_are_counted_softly_and_named(seen):
    clean = noisy(network())
    model, _ = seen(clean)
    count, rows, known = model.contradictions(model.solution())
    assert count < 3.0 and not rows.any() and not known.any() and len(rows) == 80 and len(known) == 12
    model, _ = seen(changed(clean, [66, 70], 1000.0))
    count, rows, known = model.contradictions(model.robust())
    assert np.flatnonzero(rows).tolist() == [66, 70] and not known.any()
    assert 2.0 <= count < 5.0 and not model.is_contradicted()
    model, _ = seen(changed(clean, [r for r in range(80) if r % 4 > 1], 1000.0))
    assert model.contradictions(model.solution() or model.robust())[1].mean() > 0.2
