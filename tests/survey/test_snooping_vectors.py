"""A GNSS vector is left out as a whole."""

from dataclasses import replace

import numpy as np
from test_dynadjust import network

from obseq.report.adjusted import outcome
from obseq.report.summary import summary
from obseq.survey import Quality


def test_snooping_leaves_out_whole_vectors(shared_data):
    given = network(shared_data)
    observations = given.book.observations
    cluster = next(one for one in given.book.clusters if observations.active[one.rows].all())
    row = int(cluster.rows[0])
    values = observations.values.copy()
    values[row] += 0.5
    spoilt = replace(given, book=replace(given.book, observations=replace(observations, values=values)))
    adjustment = spoilt.adjust(quality=Quality(snooping="w", snooping_level=1e-6))
    gone = np.flatnonzero(adjustment.quality.rejected)
    first = adjustment.record().rejections[0]
    ends = observations.from_points, observations.to_points
    mine = [k for k in cluster.rows.tolist() if all(end[k] == end[row] for end in ends)]
    assert len(mine) == 3 and set(mine) <= set(gone.tolist()) and len(gone) % 3 == 0
    assert first.row in mine and first.companions == 2
    assert "Its whole vector is left out." in summary(outcome(adjustment.record()))
