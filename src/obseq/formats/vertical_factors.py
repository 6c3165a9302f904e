"""Covariances of GNSS vectors whose precision upwards has a factor of its own, as STAR*NET's files say it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from obseq.survey.network import Network


def with_vertical_factors(network: Network, factors: Mapping[int, float]) -> Network:
    """The network with standard deviations along the vertical of the start of some vectors multiplied.

    With u upwards and k the factor, C becomes S C S, S = 1 + (k - 1) u u^T.

    Args:
        network: With points in space.
        factors: By the first row of each vector, which is a cluster of three.

    Raises:
        InputError: The network has no place on the Earth, so that nothing says where upwards is.
    """
    if not factors:
        return network
    book, system = network.book, network.frame.system
    if network.frame.is_plane:
        raise InputError(
            "factors of GNSS vectors along the vertical need the system of the points: --points-crs"
        )
    turn, _ = system.geocentric_pose()
    places = network.fieldwork.initial_values().coordinates
    sigmas, clusters = book.observations.sigmas.copy(), list(book.clusters)
    for k, cluster in enumerate(clusters):
        factor = factors.get(int(cluster.rows[0]))
        origin = places[book.observations.from_points[cluster.rows[0]]]
        if factor is None or not np.isfinite(origin).all():
            continue
        up = turn @ system.vertical_rotation(origin[None])[0, 2]
        stretch = np.eye(3) + (factor - 1.0) * np.outer(up, up)
        covariance = stretch @ cluster.covariance @ stretch
        clusters[k] = replace(cluster, covariance=(covariance + covariance.T) / 2.0)
        sigmas[cluster.rows] = np.sqrt(np.diag(covariance))
    observations = replace(book.observations, sigmas=sigmas)
    return replace(network, book=replace(book, observations=observations, clusters=tuple(clusters)))
